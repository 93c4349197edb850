"""Damaged entries of numba's cache on disk are compiled anew; they do not end the work.

numba unpickles whatever lies there: half a file after a full disk ends a program with whatever
that raises.
"""

from __future__ import annotations

import warnings
from typing import Any


def guard(dispatcher: Any) -> Any:
    """The compiled function; where its cache cannot be loaded, the cache is made anew."""
    cache = dispatcher._cache
    load = cache.load_overload

    def load_overload(signature: Any, target: Any) -> Any:
        try:
            return load(signature, target)
        except Exception as error:  # of any kind: bytes are unpickled
            words = f"damaged compile cache of {dispatcher.__name__}, made anew"
            warnings.warn(f"{words}: {type(error).__name__}", RuntimeWarning, stacklevel=2)
            cache.flush()
            return None

    cache.load_overload = load_overload
    return dispatcher
