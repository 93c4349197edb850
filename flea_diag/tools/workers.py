"""Worker processes that end with their parent, and work shared among them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from flea_diag.tools.garbage import search_less
from flea_diag.tools.refused import DIED, Refused
from flea_diag.wire.command_budget import begin_command, shared_sums

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_order(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int = 1, cluster: str = ""
) -> Iterator[Result | Refused]:
    """Results in the order of the items, from so many processes; with one, from this one.

    ``work`` and what it returns must be picklable. If a process dies, the next item that has no
    result is worked on alone, then the rest as before: it ends its own item and no other.
    ``cluster`` is the address of a Dask scheduler, whose workers then take the place of processes.
    """
    if cluster:
        yield from _from_cluster(work, items, cluster)
        return
    if min(jobs, len(items)) <= 1:
        yield from map(work, items)
        return
    done = 0
    while done < len(items):
        for result in _until_it_breaks(work, items[done:], jobs):
            yield result
            done += 1
        if done < len(items):
            alone = _until_it_breaks(work, items[done : done + 1], 1)
            yield next(alone, Refused(f"{items[done]}: {DIED}"))
            done += 1


def _from_cluster(
    work: Callable[[Item], Result], items: Sequence[Item], address: str
) -> Iterator[Result | Refused]:
    from flea_diag.tools.cluster import on_cluster

    early: dict[int, Result | Refused] = {}
    due = 0
    for number, _, result in on_cluster(work, items, address):
        early[number] = result
        while due in early:
            yield early.pop(due)
            due += 1


def _until_it_breaks(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[Result]:
    """Results until a process dies."""
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import active_children

    with worker_pool(min(jobs, len(items))) as pool:
        try:
            yield from pool.map(work, items)
        except BrokenProcessPool:
            return
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children():
                worker.terminate()
            raise


def worker_pool(jobs: int) -> ProcessPoolExecutor:
    """Pool of new interpreters: forking after numpy or numba have started threads can hang."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

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
    search_less()
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
