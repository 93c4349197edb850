"""Processes that share work: none outlives the one that has them."""

from __future__ import annotations

import subprocess
import sys

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
