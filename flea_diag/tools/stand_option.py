# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The options by which a command is told its stand: ``--stand`` and ``--calibration``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand


def add_stand(parser: argparse.ArgumentParser) -> None:
    """Declare ``--stand``."""
    parser.add_argument(
        "--stand",
        default="",
        metavar="DIR",
        help="folder of the stand as a path (./mine), or name of a shipped one (default: flea)",
    )


def add_calibration(parser: argparse.ArgumentParser, words: str = "calibration") -> None:
    """Declare ``--calibration``, which replaces the stand's own."""
    parser.add_argument(
        "--calibration", default="", metavar="FILE", help=f"{words} (default: that of the stand)"
    )


def chosen_stand(arguments: argparse.Namespace, *replaced: str) -> Stand:
    """The stand that the arguments name.

    Parameters
    ----------
    arguments
        Of a command with ``--stand``.
    *replaced
        Its options that replace a file of the stand, by the keys of ``stand.yaml``.

    Raises
    ------
    ConfigurationError
        There is no such stand or file.
    """
    from flea_diag.configuration.stand import load_stand

    return load_stand(arguments.stand, **{key: getattr(arguments, key) for key in replaced})


def accepted_stand(arguments: argparse.Namespace, *replaced: str) -> Stand:
    """The same, refused where a later step would refuse its description or catalogue."""
    from flea_diag.configuration.acceptance import require_accepted, require_usable

    stand = chosen_stand(arguments, *replaced)
    if stand.actuator.parent != stand.folder and not getattr(arguments, "faults", ""):
        require_usable(stand.actuator)  # the catalogue of the stand is that of another one
    else:
        require_accepted(stand)
    return stand


def absolute(stand: Stand) -> Stand:
    """The stand for a process in another folder."""
    from flea_diag.configuration.stand import FILES

    paths: dict[str, Any] = {key: getattr(stand, key) for key in FILES}
    return replace(stand, **{k: path.absolute() for k, path in paths.items() if path.exists()})


def given_stand(arguments: argparse.Namespace) -> Stand | None:
    """The stand, if the user has named one or a calibration."""
    if arguments.stand or arguments.calibration:
        return chosen_stand(arguments, "calibration")
    return None
