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

"""The parameters by which a node is told its stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flea_diag.configuration.files import DEFAULT_STAND
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class StandParameters:
    """Which stand a node is for."""

    stand: str = parameter(
        DEFAULT_STAND,
        "name of a shipped stand, or the folder of one as a path (./mine)",
        read_only=True,
    )
    calibration: str = parameter("", "calibration file; empty: that of the stand", read_only=True)


def stand_of(parameters: Any) -> Stand:
    """The stand that parameters name."""
    return load_stand(parameters.stand, calibration=parameters.calibration)
