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

"""A start loads no scipy for numba's sake, and who needs it finds it all the same."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import sys
from flea_diag.core.backend import exact

def twice(value):
    return 2 * value

exact(twice)
assert "scipy.linalg" not in sys.modules
import scipy.linalg.cython_blas
from numba.np import arraymath
assert arraymath._HAVE_BLAS
"""


def test_numba_is_loaded_without_scipy_linalg() -> None:
    pytest.importorskip("numba")
    subprocess.run([sys.executable, "-c", PROGRAM], check=True, timeout=60)
