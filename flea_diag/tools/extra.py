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

"""Optional packages of some commands, checked before any work is done."""

from __future__ import annotations

import re
import sys
from importlib.util import find_spec

from flea_diag.errors import ConfigurationError

PACKAGES: dict[str, dict[str, str]] = {
    "plot": {"matplotlib": "matplotlib"},
    "classifier": {"sklearn": "scikit-learn"},
    "evaluate": {"jinja2": "Jinja2", "tqdm": "tqdm"},
    "dask": {"distributed": "distributed"},
    "parquet": {"pyarrow": "pyarrow"},
    "excel": {"openpyxl": "openpyxl"},
    "hdf5": {"h5py": "h5py"},
    "ulog": {"pyulog": "pyulog"},
    "url": {"fsspec": "fsspec", "aiohttp": "aiohttp"},
    "frames": {"pandas": "pandas", "xarray": "xarray"},
    "completion": {"argcomplete": "argcomplete"},
}
"""Extra of setup.py -> modules that come with it, each with the package that holds it."""


def require(extra: str, what: str) -> None:
    """Check that the packages of an extra are installed.

    Raises
    ------
    ConfigurationError
        Names the option that needs them, the missing packages, and a command that installs them
        whether flea_diag came from a clone, a wheel or a workspace.
    """
    missing = [module for module in PACKAGES[extra] if find_spec(module) is None]
    if missing:
        raise ConfigurationError(
            f"{what} needs {' and '.join(missing)}, not installed: {install_command(extra)}"
        )


def install_command(extra: str) -> str:
    """What installs the packages of an extra beside this Python, at the versions of setup.py."""
    import shlex

    bounds = _bounds()
    wanted = [bounds.get(name.lower(), name) for name in PACKAGES[extra].values()]
    return shlex.join([sys.executable, "-m", "pip", "install", *wanted])


def _bounds() -> dict[str, str]:
    """Package -> requirement with its bounds, as far as the installation says."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        every = requires("flea_diag") or []
    except PackageNotFoundError:
        return {}
    plain = (entry.partition(";")[0].replace(" ", "") for entry in every)
    return {re.split(r"[<>=!~\[]", entry)[0].lower(): entry for entry in plain}
