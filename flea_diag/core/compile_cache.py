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

"""Damaged entries of numba's cache on disk are compiled anew; they do not end the work.

numba unpickles whatever lies there: half a file after a full disk ends a program with whatever
that raises.
"""

from __future__ import annotations

import warnings
from typing import Any


def guard(dispatcher: Any) -> Any:
    """The compiled function; where its cache cannot be loaded, the cache is made anew."""
    cache = getattr(dispatcher, "_cache", None)
    if cache is None:  # numba is told not to compile (NUMBA_DISABLE_JIT): it is as it was
        return dispatcher
    load = cache.load_overload

    def load_overload(signature: Any, target: Any) -> Any:
        try:
            return _of_it(dispatcher, signature, load(signature, target))
        except Exception as error:  # of any kind: bytes are unpickled
            words = f"damaged compile cache of {dispatcher.__name__}, made anew"
            warnings.warn(f"{words}: {type(error).__name__}", RuntimeWarning, stacklevel=2)
            cache.flush()
            return None

    cache.load_overload = load_overload
    return dispatcher


def _of_it(dispatcher: Any, signature: Any, loaded: Any) -> Any:
    """What was loaded, if it is this function's for these types; files are found by name alone."""
    from numba.core.sigutils import normalize_signature

    arguments, _ = normalize_signature(signature)
    name = dispatcher.py_func.__qualname__
    if loaded is not None and (loaded.fndesc.qualname, loaded.signature.args) != (name, arguments):
        raise ValueError(f"code of {loaded.fndesc.qualname}")
    return loaded
