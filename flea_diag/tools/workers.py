"""Pool of worker processes that end with their parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import ProcessPoolExecutor
from threading import Thread
from typing import Any

from flea_diag.wire.command_budget import begin_command, shared_sums


def worker_pool(jobs: int) -> ProcessPoolExecutor:
    """Pool of new interpreters: forking after numpy or numba have started threads can hang."""
    return ProcessPoolExecutor(
        jobs,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_serve,
        initargs=(shared_sums(),),
    )


def _serve(sums: Any) -> None:
    """Leave Ctrl-C to the parent and end with it, since idle workers would wait for ever.

    ``sums`` are what the command has read, which all of its processes share.
    """
    if sums is not None:
        begin_command(sums)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
