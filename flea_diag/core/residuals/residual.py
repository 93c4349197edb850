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

"""Direction of motion, by which residuals are normalised.

Multiplied by the sign of the speed (``_dn``, direction-normalised) a parameter
fault keeps one sign while a sensor bias alternates; in the raw residual it is the other way round.

Linear coordinates throughout: forces and speeds at the nut. Where the actuator stands under a
push that moves any healthy one, its direction is the sign of the push: it should go that way, and
what it lacks is a drag.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flea_diag.core.residuals.parameters import ActuatorParameters

Value = Any
"""A float, or an array of one for each of many scans: types cannot follow sums of the two."""


def direction(parameters: ActuatorParameters, speed_m_s: Value) -> Value:
    """Smooth sign of the speed."""
    # numpy's, also for one number: that of the mathematics library differs in the last bit.
    sign: Value = np.tanh(speed_m_s / parameters.stribeck_speed_m_s)
    # Numbers of numpy's own are ten times slower than Python's in all that follows.
    return float(sign) if isinstance(speed_m_s, float) else sign


STALL = 3.0
"""No healthy screw withstands a push of so many times its dry friction for long. At rest nominal
recordings of the FLEA show 2.6 times for half a second, and 3.5 times for a few scans, which the
means over windows bear."""
