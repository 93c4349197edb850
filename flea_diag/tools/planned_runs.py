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

"""How many runs a command plans: said where they are many, asked for where they are too many.

Each number of a campaign or a command line has a limit of its own; their product has this one.
"""

from __future__ import annotations

import argparse

from flea_diag.errors import ConfigurationError
from flea_diag.tools.terminal import warn

MANY = 10_000
"""From here on the number is said before the start."""
MOST = 1_000_000
OPTION = "--allow-large"


def add_option(parser: argparse.ArgumentParser) -> None:
    """Declare the option that lifts the limit."""
    parser.add_argument(
        OPTION, action="store_true", help=f"allow more than {_spaced(MOST)} runs (memory grows)"
    )


def check_planned(count: int, where: str, *, allow_large: bool = False) -> None:
    """Say or refuse a number of runs; called before any list of them is built.

    Raises
    ------
    ConfigurationError
        More than ``MOST`` runs are planned, and nobody has allowed them.
    """
    if count > MOST and not allow_large:
        raise ConfigurationError(
            f"{where}: {_spaced(count)} runs are planned, the limit is {_spaced(MOST)}: "
            f"plan fewer, or allow them with {OPTION}"
        )
    if count > MANY:
        warn(f"{where}: {_spaced(count)} runs are planned")


def _spaced(count: int) -> str:
    return f"{count:,}".replace(",", " ")
