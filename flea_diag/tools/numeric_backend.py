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

"""Identity of the numeric backend: libraries, BLAS kernels, instruction set and processor."""

from __future__ import annotations

import os
import platform
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from flea_diag.errors import shown

CPUINFO = Path("/proc/cpuinfo")
IDENTITY = ("vendor_id", "cpu family", "model")
"""Fields of the processor description by which BLAS selects its kernels."""
CHOOSING = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "GLIBC_TUNABLES")
"""Set by hand, they choose what numba compiles for, and the variants of sin and exp."""


def numeric_backend() -> str:
    """Backend for which a digest is valid, e.g. ``numpy 2.4.6, …, GenuineIntel 6 106``."""
    return ", ".join((_libraries(), *_instructions_chosen(), _processor(CPUINFO)))


def _instructions_chosen() -> list[str]:
    """Settings of the environment by which others than the processor's own instructions run."""
    return [f"{name}={shown(os.environ[name])}" for name in CHOOSING if os.environ.get(name)]


@cache
def _libraries() -> str:
    """Versions and instruction set; cached, since reading them takes longer than a short bag."""
    from importlib.metadata import version

    import numpy as np

    found = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    instructions = " ".join([platform.machine(), *found[-1:]])
    # Compiled by numba, the particle filter sums in another order.
    compiler = f"numba {version('numba')}" if find_spec("numba") else "no numba"
    libraries = f"numpy {version('numpy')}, scipy {version('scipy')}, {compiler}"
    return f"{libraries}, {_kernels()}, {instructions}"


def _kernels() -> str:
    """Kernels that BLAS selected for this processor, or that OPENBLAS_CORETYPE names."""
    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return "BLAS unknown"
    found = {
        f"{library['internal_api']} {library.get('architecture', 'unknown')}"
        for library in threadpool_info()
        if library["user_api"] == "blas"
    }
    return " ".join(sorted(found)) or "BLAS unknown"


def _processor(description: Path) -> str:
    """Vendor, family and model on Linux, elsewhere the processor name of the system."""
    try:
        lines = description.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    pairs = (line.partition(":") for line in lines)
    told = {key.strip(): value.strip() for key, _, value in reversed([*pairs])}
    return " ".join(told[key] for key in IDENTITY if key in told) or "unknown processor"
