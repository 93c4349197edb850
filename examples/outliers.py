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

"""A detector of PyOD as a diagnoser: it says that something is wrong, and not what."""

import numpy as np
from pyod.models.mcd import MCD

CHANNELS = ("motor_current", "motor_voltage", "motor_speed", "load_force", "motor_temperature")
WINDOW = 50
"""Scans whose means are scored."""
MARGIN = 2.0
"""Of the largest score in nominal runs."""


class Outliers:
    """Robust distance (minimum covariance determinant) of half-second means from nominal ones."""

    def __init__(self, stand):
        self.names = [name for name in CHANNELS if name in stand["channels"]]
        self.rows, self.limit, self.model = [], float("inf"), None

    def learn(self, runs):
        """Fit the detector, and take its largest score as the limit."""
        if not runs:
            return
        self.names = [name for name in self.names if all(name in run for run in runs)]
        means = np.concatenate([self.means([run[n] for n in self.names]) for run in runs])
        self.model = MCD().fit(means)
        self.limit = MARGIN * self.model.decision_function(means).max()

    def means(self, columns):
        """Means of each channel over each window, shape (windows, channels)."""
        values = np.nan_to_num(np.column_stack(columns))
        whole = len(values) // WINDOW
        return values[: whole * WINDOW].reshape(whole, WINDOW, -1).mean(axis=1)

    def update(self, time_s, row):
        """Score each half second at its end."""
        self.rows.append([row.get(name, 0.0) for name in self.names])
        if len(self.rows) < WINDOW or self.model is None:
            return None
        mean, self.rows = self.means(np.transpose(self.rows)), []
        return {"unknown": 1.0} if self.model.decision_function(mean)[0] > self.limit else None
