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

"""Choice of the backend: numpy, or numba where that extra is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from types import FunctionType
from typing import Any

from flea_diag.errors import ConfigurationError

NO_JIT = "NUMBA_DISABLE_JIT"
"""Variable by which numba runs what it should compile as plain Python: slower than numpy."""
BACKENDS = ("auto", "numpy", "numba")


FEW = 16
"""Scans that plain numbers take faster, one by one, than arrays of them together."""


def chosen(backend: str) -> str:
    """Backend for a name; "auto" is numba where installed and told to compile, else numpy.

    Raises
    ------
    ConfigurationError
        An unknown name, or numba asked for and not installed or told not to compile.
    """
    if backend not in BACKENDS:
        raise ConfigurationError(f"backend {backend!r} is unknown, known are {', '.join(BACKENDS)}")
    installed = find_spec("numba") is not None
    if backend == "numba" and not installed:
        raise ConfigurationError(
            "backend numba is not installed: pip install 'numba>=0.60', or choose numpy"
        )
    if not installed or backend == "numpy":
        return "numpy"
    from numba.core import config

    if backend == "numba" and config.DISABLE_JIT:
        raise ConfigurationError(f"backend numba: {NO_JIT} = 1: unset it, or choose numpy")
    return "numpy" if config.DISABLE_JIT else "numba"


@cache
def library_versions() -> str:
    """Versions of the numeric libraries, whether they are imported or not."""
    from importlib.metadata import version

    return f"numpy {version('numpy')}, scipy {version('scipy')}"


@cache
def compiled(function: Callable[..., Any], *parts: Callable[..., Any]) -> Callable[..., Any]:
    """A module's plain function of loops, compiled by numba on first call, cached on disk.

    Sums may be reordered, so that they vectorise; NaN and infinity keep their meaning.
    ``parts`` are the plain functions that it calls.
    """
    return _compiled({"fastmath": {"reassoc", "contract", "nsz", "arcp"}}, function, parts)


@cache
def exact(function: Callable[..., Any], *parts: Callable[..., Any]) -> Callable[..., Any]:
    """As ``compiled``, but no sum is reordered: the same bits as Python and numpy."""
    return _compiled({"error_model": "numpy"}, function, parts)


@contextmanager
def compiling(begun: Callable[[str], None]) -> Iterator[None]:
    """Call ``begun`` with the name of each function that numba begins to compile meanwhile.

    Functions that are compiled as part of another one are not named. Without numba, or where
    all is compiled already, nothing is called.
    """
    if find_spec("numba") is None:
        yield
        return
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        depth = 0

        def on_start(self, event: Any) -> None:
            if not self.depth:
                begun(event.data["dispatcher"].py_func.__name__)
            self.depth += 1

        def on_end(self, event: Any) -> None:
            self.depth -= 1

    with event.install_listener("numba:compile", Listener()):
        yield


def bound(function: Callable[..., Any], **names: Any) -> FunctionType:
    """The plain function with these global names bound to others: functions and constants."""
    assert isinstance(function, FunctionType)
    scope = {**function.__globals__, **names}
    made = FunctionType(function.__code__, scope, function.__name__)
    made.__module__, made.__qualname__ = function.__module__, function.__qualname__
    made.__dict__.update(function.__dict__)  # the source of generated code
    return made


def _compiled(
    options: dict[str, Any], function: Callable[..., Any], parts: tuple[Callable[..., Any], ...]
) -> Callable[..., Any]:
    _import_numba()
    from flea_diag import compile_cache

    result: Callable[..., Any] = compile_cache.compiled(function, parts, options)
    return result


@cache
def _import_numba() -> None:
    """Import the library, without a look for what multiplies matrices, which no function here does.

    It would import ``scipy.linalg`` to know whether that is there, a tenth of a start. A function
    of somebody else that does is compiled as ever: that looks once more.
    """
    import numba  # noqa: F401

    blas = "scipy.linalg.cython_blas"
    if blas not in sys.modules and "numba.np.arraymath" not in sys.modules:
        sys.modules[blas] = None  # type: ignore[assignment]  # so an import of it fails
        try:
            from numba.np import arraymath
        finally:
            del sys.modules[blas]
        arraymath._HAVE_BLAS = True
