"""``NUMBA_DISABLE_JIT=1``: numpy serves, and numba asked for by name is refused in one line."""

from __future__ import annotations

import pytest

from flea_diag.core import backend
from flea_diag.core.compile_cache import guard
from flea_diag.errors import ConfigurationError


def test_numpy_serves(monkeypatch: pytest.MonkeyPatch) -> None:
    config = pytest.importorskip("numba.core.config")
    assert backend.chosen("auto") == "numba"
    monkeypatch.setattr(config, "DISABLE_JIT", 1)
    assert backend.chosen("auto") == "numpy"


def test_numba_by_name_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    config = pytest.importorskip("numba.core.config")
    monkeypatch.setattr(config, "DISABLE_JIT", 1)
    with pytest.raises(ConfigurationError, match="NUMBA_DISABLE_JIT = 1: unset it"):
        backend.chosen("numba")


def test_a_function_that_is_not_compiled_has_no_cache_to_guard() -> None:
    assert guard(abs) is abs
