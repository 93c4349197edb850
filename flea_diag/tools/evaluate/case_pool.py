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

"""Runs of a campaign in several processes, local or on a Dask cluster, as they are done.

A run whose worker dies twice, the second time alone, is a failed line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from flea_diag.tools.campaign.case import Case
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.cluster import on_cluster
from flea_diag.tools.refused import DIED, Refused
from flea_diag.tools.workers import completed

Work = Callable[[Case], RunResult]


def run_all(cases: Iterable[Case], work: Work, jobs: int) -> Iterator[RunResult]:
    """Results of all cases from ``jobs`` processes; ``work`` must be picklable."""
    for _, case, result in completed(work, cases, jobs):
        yield failed(case, DIED) if isinstance(result, Refused) else result


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
