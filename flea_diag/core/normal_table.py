"""Standard normal numbers by table: 16 random bits choose one of 65536 quantiles.

An observer draws more numbers than it does anything else with. By table they cost a tenth of
the usual rejection method, every step takes exactly as many bits whatever happens in it (so
two backends never get out of step), and they are as good as a process noise can ask for:
symmetric, of variance one, cut at 4.3 sigma.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError

Array = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint64]

SIZE = 1 << 16
STEPS = 16
"""Steps whose random words are drawn together: one call of the generator for all."""


@lru_cache(maxsize=1)
def table() -> Array:
    """The quantiles at (k + 1/2) / 65536, scaled to a variance of exactly one."""
    from scipy.special import ndtri

    quantiles = ndtri((np.arange(SIZE) + 0.5) / SIZE)
    result: Array = quantiles / quantiles.std()
    return result


def uniform_number(words: Words) -> float:
    """A number in [0, 1) from the first word."""
    return float(words[0] >> np.uint64(11)) * 2.0**-53


def normal_numbers(words: Words, quantiles: Array, shape: tuple[int, int]) -> Array:
    """Normal numbers from the words after the first, four from each, lowest bits first."""
    chosen = words[1:].astype("<u8", copy=False).view("<u2")[: shape[0] * shape[1]]
    # Sixteen bits are never out of range; "wrap" only spares the check.
    drawn: Array = quantiles.take(chosen, mode="wrap")
    return drawn.reshape(shape)


class RandomWords:
    """Random words of a generator, the same number for every step.

    Raises
    ------
    ConfigurationError
        A bit generator of 32 bits: half of its raw output would be zeros.
    """

    def __init__(self, generator: np.random.Generator, normals: int) -> None:
        bits = generator.bit_generator
        if isinstance(bits, np.random.MT19937):
            raise ConfigurationError(
                "random generator MT19937 gives 32 bits at a time, 64 are needed: "
                "use numpy.random.default_rng(seed)"
            )
        self._raw = bits.random_raw
        self._width = 1 + (normals + 3) // 4
        self._block: list[Words] = []

    def next(self) -> Words:
        """Words for one uniform and ``normals`` normal numbers."""
        if not self._block:
            self._block = list(self._raw(STEPS * self._width).reshape(STEPS, self._width))
            self._block.reverse()
        return self._block.pop()
