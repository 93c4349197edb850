"""Optional packages of some commands, checked before any work is done."""

from __future__ import annotations

from importlib.util import find_spec

from flea_diag.errors import ConfigurationError

PACKAGES: dict[str, tuple[str, ...]] = {
    "plot": ("matplotlib",),
    "classifier": ("sklearn",),
    "evaluate": ("jinja2", "tqdm"),
    "dask": ("distributed",),
    "parquet": ("pyarrow",),
    "url": ("fsspec",),
}
"""Extra of setup.py -> modules that come with it."""


def require(extra: str, what: str) -> None:
    """Check that the packages of an extra are installed.

    Raises
    ------
    ConfigurationError
        Names the option that needs them, the missing packages, and the command to install them.
    """
    missing = [module for module in PACKAGES[extra] if find_spec(module) is None]
    if missing:
        raise ConfigurationError(
            f"{what} needs {' and '.join(missing)}, not installed: pip install 'flea_diag[{extra}]'"
        )
