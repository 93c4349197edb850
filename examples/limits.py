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

"""A diagnoser in thirty lines: a channel beyond what nominal runs reached is its sensor's fault."""

import numpy as np

IN_A_ROW = 20


class Limits:
    """Blames the sensor of the first channel that stays beyond its nominal extremes."""

    def __init__(self, stand):
        self.faults = stand["faults"]  # fault -> "component channel"
        self.limits, self.beyond = {}, {}

    def learn(self, runs):
        """Take the extremes of each channel over all nominal runs, with a margin."""
        for name in set.intersection(*map(set, runs)) - {"time_s"} if runs else ():
            values = np.concatenate([run[name] for run in runs])
            low, high = np.nanmin(values), np.nanmax(values)
            self.limits[name] = low - 0.1 * (high - low), high + 0.1 * (high - low)

    def update(self, time_s, row):
        """Return the possible faults with weights, or None for nothing new."""
        for name, (low, high) in self.limits.items():
            outside = name in row and not low <= row[name] <= high
            self.beyond[name] = self.beyond.get(name, 0) + 1 if outside else 0
            if self.beyond[name] == IN_A_ROW:
                named = [f for f, of in self.faults.items() if of.endswith(f" {name}")]
                return dict.fromkeys(named, 1.0) or {"unknown": 1.0}
        return None
