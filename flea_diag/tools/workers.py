"""Pool of worker processes that end with their parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import ProcessPoolExecutor
from threading import Thread


def worker_pool(jobs: int) -> ProcessPoolExecutor:
    """Pool of new interpreters: forking after numpy or numba have started threads can hang."""
    return ProcessPoolExecutor(
        jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_serve
    )


def _serve() -> None:
    """Leave Ctrl-C to the parent and end with it, since idle workers would wait for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
