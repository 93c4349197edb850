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

"""Processes that share work: none outlives the one that has them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from flea_diag.tools.refused import DIED, Refused
from flea_diag.tools.workers import in_order

PROGRAM = """
import os, sys, threading
from flea_diag.tools.workers import worker_pool

if __name__ == "__main__":
    pool = worker_pool(2)
    print(*set(pool.map(str, range(8))), flush=True)
    threading.Event().wait()
"""


def test_idle_workers_end_with_a_parent_that_is_killed() -> None:
    command = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert len(process.stdout.readline().split()) == 8
        process.kill()
        rest, _ = process.communicate(timeout=60.0)  # the pipe ends with the last that holds it
        assert rest == ""


def in_own_process(number: int) -> int:
    """The square; some numbers end their process."""
    if number in DEADLY:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


DEADLY = (3, 4)


def test_results_come_in_order_and_a_death_ends_its_own_item_alone() -> None:
    found = list(in_order(in_own_process, range(8), jobs=2))
    assert found == [n * n if n not in DEADLY else Refused(f"{n}: {DIED}") for n in range(8)]


def test_an_error_ends_the_work() -> None:
    with pytest.raises(ZeroDivisionError):
        list(in_order((1).__truediv__, [1, 0, 1], jobs=2))
