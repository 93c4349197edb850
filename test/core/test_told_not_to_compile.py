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

"""``NUMBA_DISABLE_JIT=1``: numpy serves, and numba asked for by name is refused in one line."""

from __future__ import annotations

import pytest

from flea_diag.core import backend
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


def test_a_function_that_is_not_compiled_is_in_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    config = pytest.importorskip("numba.core.config")
    from flea_diag import compile_cache

    monkeypatch.setattr(config, "DISABLE_JIT", 1)
    assert not hasattr(compile_cache.compiled(lambda: 1, (), {}), "_cache")
