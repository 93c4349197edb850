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

"""Runs of a campaign in several processes, local or on a Dask cluster.

Results come in the order of completion. If a worker dies, its runs are repeated; a run whose
worker dies twice, the second time alone, is a failed line.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice

from flea_diag.tools.campaign.case import Case
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.cluster import on_cluster
from flea_diag.tools.refused import DIED, Refused
from flea_diag.tools.workers import worker_pool

Work = Callable[[Case], RunResult]


def run_all(cases: Iterable[Case], work: Work, jobs: int) -> Iterator[RunResult]:
    """Results of all cases from ``jobs`` processes; ``work`` must be picklable."""
    rest = iter(cases)
    while True:
        suspects: list[Case] = []
        yield from _until_it_breaks(rest, work, jobs, suspects)
        if not suspects:
            return
        for case in suspects:  # one of them broke the pool; each alone shows which
            yield from _alone(case, work)


def _until_it_breaks(
    cases: Iterator[Case], work: Work, jobs: int, suspects: list[Case]
) -> Iterator[RunResult]:
    """Results until all are done or a worker dies; runs in progress are then suspects."""
    with worker_pool(jobs) as pool:
        running: dict[Future[RunResult], Case] = {}
        try:
            while True:
                for case in islice(cases, 2 * jobs - len(running)):
                    suspects.append(case)
                    future = pool.submit(work, case)  # a broken pool refuses it
                    running[future] = suspects.pop()
                if not running:
                    return
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    result = future.result()
                    del running[future]
                    yield result
        except BrokenProcessPool:
            suspects += running.values()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _alone(case: Case, work: Work) -> Iterator[RunResult]:
    with worker_pool(1) as pool:
        try:
            yield pool.submit(work, case).result()
        except BrokenProcessPool:
            yield failed(case, DIED)


def failed(case: Case, reason: str) -> RunResult:
    """The line of a run that could not be diagnosed."""
    return RunResult(case.id, case.kind, case.row, case.configuration, case.fold, failure=reason)


def run_on_dask(
    cases: Iterable[Case], work: Work, address: str, timeout_s: float = 10.0
) -> Iterator[RunResult]:
    """Results of all cases from a cluster; its workers need the same files.

    Raises
    ------
    ConfigurationError
        Dask is not installed, or no scheduler answers at the address.
    """
    for _, case, result in on_cluster(work, cases, address, timeout_s):
        yield failed(case, result.words) if isinstance(result, Refused) else result
