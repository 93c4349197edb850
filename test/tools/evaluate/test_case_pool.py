"""Runs over processes: all come back once, whichever worker dies on the way."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from support.evaluations import die_on_seven, name_it, numbered, say_where_then_wait, until

from flea_diag.errors import ConfigurationError
from flea_diag.tools.evaluate.case_pool import DIED, run_all, run_on_dask

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


@pytest.fixture
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="needs the extra dask")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as started:
        yield started


def test_a_dask_cluster_loses_a_worker_in_mid_run(cluster: Any, tmp_path: Path) -> None:
    work = partial(say_where_then_wait, folder=str(tmp_path))
    with ThreadPoolExecutor(1) as reader:
        results = run_on_dask(CASES, work, cluster.scheduler_address)
        collected = reader.submit(list, results)
        until(lambda: len(list(tmp_path.iterdir())) >= 2, "both workers at work")
        victim = int(next(iter(tmp_path.iterdir())).suffix[1:])
        os.kill(victim, signal.SIGKILL)
        until(lambda: len(list(tmp_path.iterdir())) >= 3, "somebody to take the work over")
        (tmp_path / "go").touch()
        found = collected.result(60.0)
    assert sorted(result.id for result in found) == NAMES
    assert [result.failure for result in found if result.failure] == []
    assert str(victim) not in {result.words for result in found}


def test_an_address_where_nobody_answers_is_refused() -> None:
    pytest.importorskip("distributed", reason="needs the extra dask")
    with pytest.raises(ConfigurationError, match="no scheduler answers"):
        next(run_on_dask(CASES, name_it, "tcp://127.0.0.1:1", timeout_s=1.0))
