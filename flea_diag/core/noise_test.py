"""The noise of each sensor against the loudest and the quietest that nominal recordings know.

An F-test on a logarithmic scale: the mean logarithm of what is left of the readings once
motion is taken out, with the scatter of a healthy sensor's own mean as the yardstick. This
unit's own first seconds count, too: a sensor that has always been louder is no fault.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.sensor_limits import NOISE_WINDOWS, RESOLUTIONS, SensorLimit, noise_logs

Array = npt.NDArray[np.float64]

UNIT_LOG = 0.3
"""A healthy sensor of another unit may be louder by this factor (logarithm)."""
QUIETER_LOG = 1.0
"""The same downwards: what is quieter than that reads nothing any more."""
WARM_UP_SCANS = 600
LARGEST_BASELINE = 0.7
"""How much louder than any nominal recording this unit's own first seconds may be (logarithm)."""
CLIP_LOG = 2.0
"""No single sample counts as louder than the loudest level by more than this (logarithm)."""


class NoiseTest:
    """Means of the logarithm of the noise, against the loudest and the quietest nominal level.

    Sums are kept in whole millionths, so that they are exact in whatever order they are made.
    """

    def __init__(self, limits: Sequence[SensorLimit]) -> None:
        count = len(limits)
        self._resolution = np.array([RESOLUTIONS[limit.channel] for limit in limits])
        self._loudest = np.array([limit.loudest for limit in limits])
        self._floor = np.array([limit.quietest for limit in limits]) - QUIETER_LOG
        scatter = np.array([limit.scatter for limit in limits])
        self._sigma = scatter / np.sqrt(np.array(NOISE_WINDOWS))[:, None]
        self._rows = np.zeros((NOISE_WINDOWS[-1], 2 * count), dtype=np.int64)
        self._sums = np.zeros((len(NOISE_WINDOWS), 2 * count), dtype=np.int64)
        self._first = np.zeros(2 * count, dtype=np.int64)
        self._scans = 0
        # Until its first seconds are over, this unit may be as loud as one ever is.
        self._ceiling = self._loudest + UNIT_LOG + LARGEST_BASELINE

    def step(self, recent: Array) -> Array:
        """Z of each channel after each row; ``recent`` begins three rows before the first."""
        left = WARM_UP_SCANS - self._scans
        if 0 < left < len(recent) - 3:
            # What was learned holds from the next row on, in a block as row by row.
            parts = recent[: left + 3], recent[left:]
            return np.concatenate([self.step(part) for part in parts])
        logs = np.minimum(noise_logs(recent, self._resolution), self._loudest + CLIP_LOG)
        valid = np.isfinite(logs)
        new = np.concatenate((np.where(valid, np.rint(logs * 1e6), 0.0), valid), axis=1)
        rows = np.concatenate((self._rows, new.astype(np.int64)))
        count, longest = len(logs), NOISE_WINDOWS[-1]
        self._rows = rows[count:]
        found = np.zeros(logs.shape)
        for place, window in enumerate(NOISE_WINDOWS):
            change = rows[longest:] - rows[longest - window : longest - window + count]
            sums = self._sums[place] + np.cumsum(change, axis=0)
            self._sums[place] = sums[-1]
            z = self._z(sums, window, self._sigma[place])
            found = np.where(np.abs(z) > np.abs(found), z, found)
        self._learn(rows[longest:])
        return found

    def _z(self, sums: npt.NDArray[np.int64], window: int, sigma: Array) -> Array:
        total, samples = np.split(sums, 2, axis=1)
        # Half of the window must have been measured.
        mean = np.where(2 * samples >= window, 1e-6 * total / np.maximum(samples, 1), np.nan)
        over = np.maximum(mean - self._ceiling, 0.0)
        z: Array = np.nan_to_num(over + np.minimum(mean - self._floor, 0.0)) / sigma
        return z

    def _learn(self, new: npt.NDArray[np.int64]) -> None:
        """How much louder this unit is than any nominal recording, in its first seconds."""
        if self._scans >= WARM_UP_SCANS:
            return
        self._first += new.sum(axis=0)
        self._scans += len(new)
        if self._scans >= WARM_UP_SCANS:
            total, samples = np.split(self._first, 2)
            louder = np.where(samples, 1e-6 * total / np.maximum(samples, 1) - self._loudest, 0.0)
            self._ceiling = self._loudest + UNIT_LOG + np.clip(louder, 0.0, LARGEST_BASELINE)
