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
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from itertools import islice
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

    ``cluster`` is the address of a Dask scheduler, whose workers then take the place of processes;
    ``pool_of`` gives the pool of so many processes, by default a new one.
    """
    from flea_diag.tools.cluster import on_cluster

    jobs = min(jobs, len(items))
    if not cluster and jobs <= 1:
        yield from map(work, items)
        return
    early: dict[int, Result | Refused] = {}
    due = 0
    found = on_cluster(work, items, cluster) if cluster else completed(work, items, jobs, pool_of)
    for number, _, result in found:
        early[number] = result
        while due in early:
            yield early.pop(due)
            due += 1


def completed(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    jobs: int,
    pool_of: PoolOf | None = None,
) -> Iterator[tuple[int, Item, Result | Refused]]:
    """Number, item and result of each item from so many processes, in the order of completion.

    ``work`` and what it returns must be picklable. If a process dies, the items in work are
    repeated, each alone: it ends its own item and no other.
    """
    rest = enumerate(items)
    while True:
        suspects: list[tuple[int, Item]] = []
        yield from _until_it_breaks(work, rest, jobs, pool_of or worker_pool, suspects)
        if not suspects:
            return
        for number, item in suspects:  # one of them broke the pool; each alone shows which
            alone = _until_it_breaks(work, iter([(number, item)]), 1, worker_pool, [])
            yield from list(alone) or [(number, item, Refused(f"{item}: {DIED}"))]


def _until_it_breaks(
    work: Callable[[Item], Result],
    items: Iterator[tuple[int, Item]],
    jobs: int,
    pool_of: PoolOf,
    suspects: list[tuple[int, Item]],
) -> Iterator[tuple[int, Item, Result | Refused]]:
    """Results until all are done or a process dies; what was in work is then suspect."""
    from concurrent.futures import FIRST_COMPLETED, Future, wait
    from concurrent.futures.process import BrokenProcessPool

    running: dict[Future[Result], tuple[int, Item]] = {}
    with suppress(BrokenProcessPool), pool_of(jobs) as pool:
        try:
            while True:
                for entry in islice(items, 2 * jobs - len(running)):
                    suspects.append(entry)
                    future = pool.submit(work, entry[1])  # a broken pool refuses it
                    running[future] = suspects.pop()
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    result = future.result()
                    yield (*running.pop(future), result)
        except BrokenProcessPool:
            suspects += running.values()
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
