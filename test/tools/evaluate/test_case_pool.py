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

"""Runs over processes: all come back once, whichever worker dies on the way."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator

from support.evaluations import die_on_seven, name_it, numbered, until

from flea_diag.tools.campaign.case import Case
from flea_diag.tools.evaluate.case_pool import run_all
from flea_diag.tools.refused import DIED

CASES = numbered(12)
NAMES = sorted(case.id for case in CASES)


def test_every_case_comes_back_once_from_another_process() -> None:
    results = list(run_all(CASES, name_it, 2))
    assert sorted(result.id for result in results) == NAMES
    assert str(os.getpid()) not in {result.words for result in results}


def test_a_run_that_takes_its_process_down_is_one_failed_line() -> None:
    results = list(run_all(CASES, die_on_seven, 2))
    assert sorted(result.id for result in results) == NAMES
    assert {result.id: result.failure for result in results if result.failure} == {"n/7": DIED}


def test_a_run_that_a_broken_pool_refuses_is_not_lost() -> None:
    def drawn() -> Iterator[Case]:
        yield from CASES[7:8]
        until(lambda: not multiprocessing.active_children(), "the death of the worker")
        yield from CASES[8:]

    results = list(run_all(drawn(), die_on_seven, 1))
    assert sorted(result.id for result in results) == sorted(case.id for case in CASES[7:])
