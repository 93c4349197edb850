"""Which backend computes: numpy, or numba where that extra is installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any

from flea_diag.errors import ConfigurationError

BACKENDS = ("auto", "numpy", "numba")


def chosen(backend: str) -> str:
    """The backend meant by a name; "auto" takes numba where it is installed.

    Raises
    ------
    ConfigurationError
        An unknown name, or numba asked for and not installed.
    """
    if backend not in BACKENDS:
        raise ConfigurationError(f"backend {backend!r} is unknown, known are {', '.join(BACKENDS)}")
    installed = find_spec("numba") is not None
    if backend == "numba" and not installed:
        raise ConfigurationError(
            "backend numba is not installed: pip install 'flea_diag[numba]', or choose numpy"
        )
    return "numba" if installed and backend != "numpy" else "numpy"


@cache
def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """A module's plain function of loops, compiled by numba on first call, cached on disk.

    Sums may be reordered, so that they vectorise; NaN and infinity keep their meaning.
    """
    import numba

    options: dict[str, Any] = {"fastmath": {"reassoc", "contract", "nsz", "arcp"}}
    try:
        result: Callable[..., Any] = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # nowhere to keep a cache: a read-only installation
        result = numba.njit(**options)(function)
    return result
