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

"""Worker processes that end with their parent, and work shared among them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from flea_diag.errors import ConfigurationError
from flea_diag.tools.argument import MOST_JOBS
from flea_diag.tools.garbage import search_less
from flea_diag.tools.refused import DIED, Refused
from flea_diag.wire.command_budget import begin_command, shared_sums

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

    PoolOf = Callable[[int], AbstractContextManager[ProcessPoolExecutor]]

Item = TypeVar("Item")
Result = TypeVar("Result")


def jobs_of(given: int | None) -> int:
    """Processes that a user asks for; one for each core where nothing is said.

    Raises
    ------
    ConfigurationError
        So many are none, or too many.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    jobs = given if given is not None else cores or 1
    if not 1 <= jobs <= MOST_JOBS:
        raise ConfigurationError(f"-j {jobs}: must be from 1 to {MOST_JOBS}")
    return jobs


def in_order(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int = 1,
    cluster: str = "",
    pool_of: PoolOf | None = None,
) -> Iterator[Result | Refused]:
    """Results in the order of the items, from so many processes; with one, from this one.

    ``work`` and what it returns must be picklable. If a process dies, the next item that has no
    result is worked on alone, then the rest as before: it ends its own item and no other.
    ``cluster`` is the address of a Dask scheduler, whose workers then take the place of processes;
    ``pool_of`` gives the pool of so many processes, by default a new one.
    """
    pool_of = pool_of or worker_pool
    if cluster:
        yield from _from_cluster(work, items, cluster)
        return
    if min(jobs, len(items)) <= 1:
        yield from map(work, items)
        return
    done = 0
    while done < len(items):
        for result in _until_it_breaks(work, items[done:], jobs, pool_of):
            yield result
            done += 1
        if done < len(items):
            alone = _until_it_breaks(work, items[done : done + 1], 1, worker_pool)
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
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int, pool_of: PoolOf
) -> Iterator[Result]:
    """Results until a process dies."""
    from concurrent.futures.process import BrokenProcessPool

    with suppress(BrokenProcessPool), pool_of(min(jobs, len(items))) as pool:
        try:
            yield from pool.map(work, items)
        except BrokenProcessPool:
            raise
        except BaseException:
            _end(pool)
            raise


def _end(pool: ProcessPoolExecutor) -> None:
    """End a pool at once, whatever it is working on."""
    from multiprocessing import active_children

    pool.shutdown(wait=False, cancel_futures=True)
    for worker in active_children():
        worker.terminate()


class KeptPool:
    """A pool for several rounds of work: its processes import and compile once.

    Use as ``pool_of``, inside a ``with``, which ends it.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._pool: ProcessPoolExecutor | None = None

    @contextmanager
    def __call__(self, _jobs: int) -> Iterator[ProcessPoolExecutor]:
        """The pool, a new one if the last has broken."""
        self._pool = self._pool or worker_pool(self._jobs)
        try:
            yield self._pool
        except BaseException:
            self._pool = None
            raise

    def __enter__(self) -> KeptPool:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown()


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
