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

"""A Dask cluster in place of processes: the same results, whichever worker dies."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from support.decisions import BAGS
from support.evaluations import name_it, numbered, say_where_then_wait, until

from flea_diag.errors import ConfigurationError
from flea_diag.tools.evaluate.case_pool import run_on_dask
from flea_diag.tools.main import main
from flea_diag.tools.workers import in_order

CASES = numbered(12)
NAMES = [case.id for case in CASES]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="needs the extra dask")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as started:
        yield started


@pytest.mark.in_turn(2)
def test_a_replay_gives_what_it_gives_here(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(BAGS)  # the workers are in another folder
    command = ["replay", "nominal", "jam", "none", "-q", "--json"]
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    assert main([*command, str(here)]) == 1
    assert main([*command, str(there), "--dask", cluster.scheduler_address]) == 1
    assert there.read_text(encoding="utf-8") == here.read_text(encoding="utf-8")
    assert [each["bag"] for each in json.loads(here.read_text())] == ["nominal", "jam"]


def test_an_error_is_that_of_the_command(
    cluster: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = ["--calibration", str(tmp_path / "none.yaml")]
    assert main(["replay", str(BAGS / "jam"), *missing, "--dask", cluster.scheduler_address]) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_it_loses_a_worker_in_mid_run(cluster: Any, tmp_path: Path) -> None:
    work = partial(say_where_then_wait, folder=str(tmp_path))
    with ThreadPoolExecutor(1) as reader:
        results = in_order(work, CASES, cluster=cluster.scheduler_address)
        collected = reader.submit(list, results)
        until(lambda: len(list(tmp_path.iterdir())) >= 2, "both workers at work")
        victim = int(next(iter(tmp_path.iterdir())).suffix[1:])
        os.kill(victim, signal.SIGKILL)
        until(lambda: len(list(tmp_path.iterdir())) >= 3, "somebody to take the work over")
        (tmp_path / "go").touch()
        found = collected.result(60.0)
    assert [result.id for result in found] == NAMES
    assert str(victim) not in {result.words for result in found}


def test_a_campaign_runs_on_it(cluster: Any) -> None:
    results = list(run_on_dask(CASES, name_it, cluster.scheduler_address))
    assert sorted(result.id for result in results) == sorted(NAMES)
    assert str(os.getpid()) not in {result.words for result in results}


def test_an_address_where_nobody_answers_is_refused() -> None:
    pytest.importorskip("distributed", reason="needs the extra dask")
    with pytest.raises(ConfigurationError, match="no scheduler answers"):
        next(run_on_dask(CASES, name_it, "tcp://127.0.0.1:1", timeout_s=1.0))
