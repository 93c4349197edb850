"""Packages that only some commands need: asked for before any work is done, with the remedy."""

from __future__ import annotations

from importlib.util import find_spec

from flea_diag.errors import ConfigurationError

PACKAGES: dict[str, tuple[str, ...]] = {
    "plot": ("matplotlib",),
    "classifier": ("sklearn",),
    "evaluate": ("jinja2", "tqdm"),
    "dask": ("distributed",),
}
"""Extra of setup.py -> modules that come with it."""


def require(extra: str, what: str) -> None:
    """See that the packages of an extra are there.

    Raises
    ------
    ConfigurationError
        Naming what needs them, what is missing, and the command that installs it.
    """
    missing = [module for module in PACKAGES[extra] if find_spec(module) is None]
    if missing:
        raise ConfigurationError(
            f"{what} needs {' and '.join(missing)}, not installed here: "
            f"pip install 'flea_diag[{extra}]'"
        )
