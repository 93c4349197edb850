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

"""The whole stand as processes: started, ended and summed up by `flea_diag.nodes.run.live_run`."""

from __future__ import annotations

import itertools
import os
import signal
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

import pytest
from support.live import Peer, Process, children, node, process_of

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.run.children import Children
from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.live_run import machine_of, main, parsed
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Scan, Truth


def command(bag: Path, *arguments: str) -> list[str]:
    module = "flea_diag.nodes.run.live_run"
    return [sys.executable, "-m", module, "--headless", "--bag", str(bag), *arguments]


@pytest.mark.in_turn(2)
def test_nodes_that_are_killed_come_back_and_an_interrupted_run_sums_up(
    domain: int, tmp_path: Path
) -> None:
    with Process(command(tmp_path / "run", "--for", "600", "--at", "7"), domain) as process:
        process.wait_for("ISOLATED", limit_s=180.0)
        for name in ("isolator", "recorder"):
            os.kill(process_of(process.child.pid, name), signal.SIGKILL)
        for name in ("isolator", "recorder"):
            process.wait_for(f"{name} was ended by SIGKILL: restart 1 of at most 3")
        process.output = ""
        process.wait_for("jam", limit_s=180.0)  # the new isolator knows of the open episode
        until_recorded(tmp_path / "run_2")
        started = children(process.child.pid)
        assert process.signal(signal.SIGINT) == 1, process.output
    assert len(started) == 6
    assert not [pid for pid in started if Path(f"/proc/{pid}").exists()]
    for word in ("truth", "diagnosis", "features", str(tmp_path / "run"), "interrupted"):
        assert word in process.output
    folders = sorted(each.name for each in tmp_path.iterdir() if each.is_dir())
    bags = [name for name in folders if not name.endswith("-clips")]
    assert bags == ["run", "run_2"]
    kinds = {type(record) for _, record in read_bag(tmp_path / "run")}
    assert {Scan, ChannelTable, Truth, AmbiguityGroup} <= kinds
    stamps = [[record.stamp_ns for _, record in read_bag(tmp_path / bag, (Scan,))] for bag in bags]
    # Whole up to a second before the fall, and again from the recorder's return to the end.
    assert stamps[0][-1] < stamps[1][0]
    assert all(b - a == 10_000_000 for part in stamps for a, b in itertools.pairwise(part))


@pytest.mark.in_turn(2)
def test_a_diagnoser_that_was_killed_takes_its_verdict_over(domain: int, tmp_path: Path) -> None:
    """Nobody else is left to tell it of what was before."""
    fault = ("--fault", "motor_temperature_bias", "--at", "8", "--for", "600")
    run = command(tmp_path / "run", "--composed", *fault)
    with Process(run, domain, XDG_STATE_HOME=str(tmp_path)) as process:
        process.wait_for("DETECTED", limit_s=180.0)
        os.kill(process_of(process.child.pid, "diagnoser"), signal.SIGKILL)
        process.wait_for("diagnoser was ended by SIGKILL: restart 1 of at most 3")
        process.output = ""
        process.wait_for("before observer and isolator restarted", limit_s=180.0)
        assert "NOMINAL" not in process.output
        assert process.signal(signal.SIGINT) == 1, process.output


def test_the_nodes_of_another_stand_diagnose_it(domain: int) -> None:
    """Healthy for two seconds; numpy, for its relations are compiled longer than it runs."""
    given = ("stand:=wing", "observer_backend:=numpy", "memory:=none")
    run = ("machine:=wing", "duration_s:=2.0", "wait_for:=diagnoser")
    diagnoser, daq = (
        node(name, *(part for each in values for part in ("-p", each)))
        for name, values in (("diagnoser", given), ("daq", run))
    )
    with Process(diagnoser, domain) as judge, Process(daq, domain) as stand, Peer(domain) as peer:
        peer.listen(AmbiguityGroup)
        last = peer.find(lambda group: group.outcome is Outcome.NOMINAL and group.stale)
        assert (last.members, stand.end()) == ((), 0), stand.output
        assert judge.child.poll() is None


def until_recorded(bag: Path, limit_s: float = 30.0) -> None:
    """Wait until a bag that is still written to holds a scan."""
    deadline_s = time.monotonic() + limit_s
    while not ((bag / "metadata.yaml").exists() and any(read_bag(bag, (Scan,)))):
        assert time.monotonic() < deadline_s, f"no scan in {bag} within {limit_s} s"


def test_a_node_that_keeps_falling_is_given_up(tmp_path: Path) -> None:
    told: list[str] = []
    first = tmp_path / "sitecustomize.py"  # what Python runs before anything else
    first.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n")
    with (tmp_path / "log").open("wb") as log:
        falling = Children(log, told.append)
        with patch.dict(os.environ, {"PYTHONPATH": str(tmp_path)}):
            falling.start("observer", {})
            with pytest.raises(
                ConfigurationError, match=r"observer.*SIGKILL.*3 restarts.*run stopped"
            ):
                give_up(falling)
        falling.end()
    assert [line.partition("restart ")[2] for line in told] == [
        f"{k} of at most 3" for k in (1, 2, 3)
    ]


def give_up(falling: Children) -> None:
    deadline_s = time.monotonic() + 30.0
    while time.monotonic() < deadline_s:
        falling.supervise((), lambda _: {})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fault", "gremlin"], ("unknown fault 'gremlin'", "jam")),
        (["--bag", "{here}"], ("{here}", "exists: name a new bag")),
    ],
)
def test_what_a_node_refuses_ends_the_run_before_any_is_started(
    domain: int, tmp_path: Path, arguments: list[str], words: tuple[str, ...]
) -> None:
    here = str(tmp_path)
    given = [each.format(here=here) for each in arguments]
    with Process(command(tmp_path / "run", *given), domain) as process:
        assert process.end() == 2
    last = process.output.splitlines()[-1]
    assert all(word.format(here=here) in last for word in words), process.output
    assert "starting" not in process.output


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--at", "40"], "--at 40: the onset must lie before the end"),
        (["--for", "-1"], "must lie between 0 and 86400 s"),
        (["--for", "soon"], "invalid number of seconds: 'soon'"),
        (["--speed", "2"], "unrecognized"),
    ],
)
def test_bad_options_are_refused(
    arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parsed(arguments)
    assert ended.value.code == 2
    assert word in capsys.readouterr().err


def test_a_log_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert main(["--headless", "--bag", str(tmp_path / "file" / "run")]) == 2
    assert "run.log: cannot be written" in capsys.readouterr().err


def test_defaults_are_a_jam_at_eight_seconds() -> None:
    options = parsed([])
    assert (options.fault, options.at, options.headless) == ("jam", 8.0, False)
    assert options.bag.parent == Path("bags/runs")


def test_two_reserved_domains_differ_and_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # nobody else reserves there
    with reserved_domain() as one, reserved_domain() as two:
        assert one != two
    with reserved_domain() as again:
        assert again == one


@pytest.mark.parametrize(
    ("arguments", "machine"),
    [
        ((), ""),
        (("--stand", "ema"), "ema"),
        (("--stand", "./stands/ema"), "ema"),
        (("--stand", "ema", "--machine", "./mine.yaml"), "./mine.yaml"),
        (("--stand", "ema", "--scenario", "./mine.yaml"), ""),
    ],
)
def test_the_machine_of_the_stands_name_is_simulated(
    arguments: tuple[str, ...], machine: str
) -> None:
    assert machine_of(parsed(arguments)) == machine
