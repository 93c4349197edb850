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

"""What a stand's files say, for all that is done with its recordings."""

from __future__ import annotations

from typing import Any

from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.wire.sources.mapping import SourceMapping

OTHERS = {"commanded_position": "m", "commanded_load": "N", "load_motor_current": "A"}
"""Channels that recordings hold and no diagnosis needs -> unit."""


def files_of(stand: Any) -> Stand:
    """Files of a stand however it is named: ``fd.Stand``, a calibration, a name or a folder.

    None or "" is the shipped FLEA.

    Raises
    ------
    ConfigurationError
        There is no such stand.
    """
    if isinstance(stand, Stand):
        return stand
    files = getattr(stand, "files", None)
    return files if isinstance(files, Stand) else load_stand(stand or "")


def channels_of(stand: Stand) -> dict[str, str]:
    """Channel -> unit of all that the description measures, and of standard channels."""
    from flea_diag.configuration.description import described
    from flea_diag.core.residuals.channel_units import UNITS

    model = described(stand.actuator)
    return {**UNITS, **OTHERS, **model.units}


def mapping_of(stand: Stand) -> SourceMapping | None:
    """Where its channels come from; None where it sends them itself.

    Raises
    ------
    ConfigurationError
        Its channels.yaml is refused.
    """
    from flea_diag.configuration.channels import channel_sources

    return None if stand.channels is None else channel_sources(stand)
