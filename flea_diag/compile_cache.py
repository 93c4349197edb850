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

"""What numba compiles is kept on disk by its content, not by the place and time of its sources.

So an installed copy, a source tree and another installation with the same numba share it, and a
change compiles anew what it touches. Damaged entries are compiled anew, too; they do not end the
work: numba unpickles whatever lies there, and half a file after a full disk ends a program with
whatever that raises. Only import this where numba is installed.
"""

from __future__ import annotations

import hashlib
import os
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.sigutils import normalize_signature
from numba.extending import register_jitable

from flea_diag.cache_folder import cache_folder

FOLDER = "compiled"
PRIVATE = 0o700
WRITABLE_BY_OTHERS = 0o022
UNUSED_S = 90 * 86400.0
"""Seconds after which code is deleted that nobody has loaded: a season in which a stand rests."""
FIXED = ("math", "numpy")
"""Modules that compiled functions may name: what they take from them stays within a version."""
PART = {"forceinline": True, "no_cfunc_wrapper": True}
"""Parts are always inlined.

As calls they would be symbols, which a program that has just compiled them may share among
functions and one that loads them from disk may not; sums reordered in different ways differ in
their last bits. Nothing else calls them, so they need no entry for C, which took a tenth of the
time to compile.
"""

Function = Callable[..., Any]


def compiled(function: Function, parts: Iterable[Function], options: Mapping[str, Any]) -> Any:
    """The function, compiled by numba on first call and kept by its content.

    ``parts`` are the plain functions that it calls. All is compiled in each process anew where
    nothing can be kept.
    """
    for part in parts:
        register_jitable(**PART, **options)(part)
    made = numba.njit(**options)(_named(function, options))
    if hasattr(made, "_cache"):  # else numba is told not to compile: it is a plain function
        with suppress(RuntimeError, OSError):  # a read-only installation, a user without a home
            made._cache = _ContentCache(made.py_func)
    return made


def code_folder() -> Path:
    """The folder of compiled code, below that of numba where the user has named one."""
    return Path(config.CACHE_DIR, "flea_diag") if config.CACHE_DIR else cache_folder() / FOLDER


def is_private(folder: Path) -> bool:
    """Whether nobody else can write there: what is loaded from it is run."""
    told = folder.stat()
    return told.st_uid == os.geteuid() and not told.st_mode & WRITABLE_BY_OTHERS


def _named(function: Any, options: Mapping[str, Any]) -> FunctionType:
    """The function under a name with a digest of all that its compiled code is made from.

    Entries are found by name, and code carries its name, by which it is known again.
    """
    digest = hashlib.sha256()
    versions = (np.__version__, llvmlite.__version__)
    chosen = [(name, _sorted(value)) for name, value in sorted(options.items())]
    for item in (function.__module__, versions, PART, chosen, *_content(function, {})):
        digest.update(f"{item!r}\n".encode())
    named = FunctionType(
        function.__code__, function.__globals__, function.__name__,
        function.__defaults__, function.__closure__,
    )  # fmt: skip
    named.__qualname__ = f"{function.__qualname__}_{digest.hexdigest()[:32]}"
    return named


def _sorted(value: Any) -> Any:
    return sorted(value) if isinstance(value, set) else value


def _content(function: FunctionType, known: dict[FunctionType, int]) -> Iterator[Any]:
    """Code of a function and of all that it calls, and the values of global names: constants."""
    known[function] = len(known)
    codes = [function.__code__]
    for code in codes:  # and of what is defined in it
        constants = [each for each in code.co_consts if not isinstance(each, CodeType)]
        yield code.co_code, code.co_names, code.co_varnames, constants
        codes += (each for each in code.co_consts if isinstance(each, CodeType))
    yield function.__defaults__, [cell.cell_contents for cell in function.__closure__ or ()]
    names = {name for code in codes for name in code.co_names}
    for name, value in _values(names, function.__globals__):
        if isinstance(value, FunctionType):
            if value not in known:
                yield from _content(value, known)
            yield name, known[value]
        else:
            told = value.tolist() if isinstance(value, np.ndarray) else value
            yield name, type(value), told, getattr(value, "_fields", ())


def _values(
    names: set[str], scope: Mapping[str, Any], within: tuple[ModuleType, ...] = ()
) -> Iterator[tuple[str, Any]]:
    """What these names stand for, in modules of ours, too."""
    for name in sorted(names & scope.keys()):
        value = scope[name]
        if not isinstance(value, ModuleType):
            yield name, value
        elif value.__name__ in FIXED:
            yield name, value.__name__
        elif value not in within:
            yield from _values(names, vars(value), (*within, value))


class _ContentLocator(_CacheLocator):  # type: ignore[misc]
    """Places entries in the one folder; their names say all, so no source is looked at."""

    def __init__(self, py_file: str) -> None:
        self._py_file = py_file  # named in what numba says of code that cannot be kept

    def get_cache_path(self) -> str:
        return str(code_folder())

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return "content"

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> _ContentLocator | None:
        """The locator; none where the folder cannot be written, or others can write to it."""
        with suppress(RuntimeError, OSError):
            folder = code_folder()
            folder.parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=PRIVATE, exist_ok=True)
            made = cls(py_file)
            made.ensure_cache_path()
            return made if is_private(folder) else None
        return None


class _ContentImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_ContentLocator, *CompileResultCacheImpl._locator_classes)


class _ContentCache(FunctionCache):  # type: ignore[misc]
    """numba's cache by content, in which what cannot be loaded is made anew."""

    _impl_class = _ContentImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was kept for these types, or None."""
        try:
            loaded = _of_it(self._py_func, sig, super().load_overload(sig, target_context))
        except Exception as error:  # of any kind: bytes are unpickled
            words = f"damaged compile cache of {self._py_func.__name__}, made anew"
            warnings.warn(f"{words}: {type(error).__name__}", RuntimeWarning, stacklevel=2)
            self.flush()
            return None
        if loaded is not None:
            with suppress(OSError):  # in use: see ``UNUSED_S``
                os.utime(self._cache_file._index_path)
        return loaded

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep code, and delete what was made of the same function and is not used any more."""
        family = self._impl.filename_base.rpartition("_")[0]
        with suppress(OSError):  # a full disk: the code runs all the same
            super().save_overload(sig, data)
            for index in Path(self.cache_path).glob(f"{family}_*.nbi"):
                if index.stat().st_mtime < time.time() - UNUSED_S:
                    for file in index.parent.glob(f"{index.stem}.*"):
                        file.unlink(missing_ok=True)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """As numba's, with the fields of named tuples: it takes two of the same class for one."""
        arguments, _ = normalize_signature(sig)
        return (*super()._index_key(sig, codegen), tuple(map(_fields, arguments)))


def _fields(kind: Any) -> tuple[Any, ...]:
    if not isinstance(kind, numba.types.BaseTuple):
        return ()
    return (getattr(kind, "fields", ()), *map(_fields, kind))


def _of_it(function: Any, signature: Any, loaded: Any) -> Any:
    """What was loaded, if it is this function's for these types; files are found by name alone."""
    arguments, _ = normalize_signature(signature)
    name = function.__qualname__
    if loaded is not None and (loaded.fndesc.qualname, loaded.signature.args) != (name, arguments):
        raise ValueError(f"code of {loaded.fndesc.qualname}")
    return loaded
