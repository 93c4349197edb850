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

"""What a recording says of its coefficients, in the noise of the law: sums, and nothing else.

Of a recording of any length this is all that is kept: memory grows with the number of recordings
by some hundred numbers each.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.law_noise import WhiteRun

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class RunSums:
    """Sums over white windows, of one recording or of several, along the first axis.

    Attributes
    ----------
    gram
        X' X, shape (..., columns, columns).
    cross
        X' y, shape (..., columns).
    square
        y' y, shape (...,).
    count
        Values, shape (...,).
    log_scale
        Log density of the scales, shape (...,).
    """

    gram: Array
    cross: Array
    square: Array
    count: Array
    log_scale: Array

    @classmethod
    def of(cls, white: WhiteRun) -> RunSums:
        """Sums of one recording."""
        rows = white.rows.reshape(-1, white.rows.shape[-1])
        products = rows.T @ rows
        return cls(
            products[1:, 1:],
            products[1:, 0],
            products[0, 0],
            np.asarray(float(white.known.sum())),
            np.asarray(white.log_scale),
        )

    @classmethod
    def stacked(cls, sums: Iterable[RunSums]) -> RunSums:
        """Several along a new first axis."""
        every = list(sums)
        fields = ("gram", "cross", "square", "count", "log_scale")
        return cls(*(np.stack([getattr(each, name) for each in every]) for name in fields))

    def __len__(self) -> int:
        return len(self.gram)

    def __getitem__(self, which: int | Places) -> RunSums:
        fields = (self.gram, self.cross, self.square, self.count, self.log_scale)
        return RunSums(*(np.asarray(entry[which]) for entry in fields))

    @property
    def total(self) -> RunSums:
        """The sum of several, as of one long recording."""
        fields = (self.gram, self.cross, self.square, self.count, self.log_scale)
        return RunSums(*(entry.sum(axis=0) for entry in fields))

    def first(self, columns: int) -> RunSums:
        """The same of the first columns alone."""
        gram, cross = self.gram[..., :columns, :columns], self.cross[..., :columns]
        return RunSums(gram, cross, self.square, self.count, self.log_scale)

    def beside(self, mean: Array) -> RunSums:
        """The same of what is left beside these coefficients."""
        pulled = np.matmul(self.gram, mean)
        square = self.square - 2.0 * self.cross @ mean + pulled @ mean
        return RunSums(self.gram, self.cross - pulled, square, self.count, self.log_scale)

    def freed(self, variance: Array) -> RunSums:
        """The same with coefficients of these variances, shape (columns,), integrated out.

        Their log density is in ``log_scale``; what is left says something of what they scatter
        about.
        """
        kept, log_det = posterior_covariance(self.gram, variance)
        explained = np.matmul(self.gram, kept)
        return RunSums(
            self.gram - np.matmul(explained, self.gram),
            self.cross - np.matmul(explained, self.cross[..., None])[..., 0],
            self.square - np.einsum("...i,...ij,...j->...", self.cross, kept, self.cross),
            self.count,
            self.log_scale - 0.5 * log_det,
        )


def posterior_covariance(gram: Array, variance: Array) -> tuple[Array, Array]:
    """(gram + 1 / variance)^-1 and log det (1 + variance gram), for many; a variance may be 0."""
    sigma = np.sqrt(variance)
    inner = np.eye(len(sigma)) + sigma[:, None] * gram * sigma
    covariance = sigma[:, None] * np.linalg.inv(inner) * sigma
    return np.asarray(covariance), np.asarray(np.linalg.slogdet(inner)[1])
