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

"""How every node starts and ends: help, parameters, signals, exit status."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.live import ROOT, Peer, Process, environment, node, toy

from flea_diag.nodes.executables import program_of
from flea_diag.wire.bus.program import usage
from flea_diag.wire.records import Health
from flea_diag.wire.topics import TOPICS

INT, TERM = signal.SIGINT, signal.SIGTERM


@pytest.mark.parametrize("executor", ["events", "single"])
@pytest.mark.parametrize("signals", [(INT,), (INT, INT), (TERM,), (TERM, INT)])
def test_signals_end_a_node_in_order(
    domain: int, executor: str, signals: tuple[signal.Signals, ...], tmp_path: Path
) -> None:
    command = node("recorder", "-p", f"executor:={executor}")
    with Process(command, domain, cwd=tmp_path) as process:
        process.wait_for(f"recording {len(TOPICS)} topics")
        status = process.signal(*signals)
    assert status == 0
    assert "Traceback" not in process.output


def test_a_node_that_was_stopped_goes_on(domain: int) -> None:
    """As by Ctrl-Z, a debugger, or the host of a virtual machine."""
    with Process(toy(), domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        state = Path(f"/proc/{process.child.pid}/stat")
        process.child.send_signal(signal.SIGSTOP)
        peer.until(lambda: state.read_text().split()[2] == "T")
        stopped_s = time.monotonic()
        peer.until(lambda: time.monotonic() - stopped_s > 0.5)
        process.child.send_signal(signal.SIGCONT)
        reported = len(peer.records)
        peer.until(lambda: len(peer.records) > reported + 1)
        assert process.signal(INT) == 0


def test_what_a_start_has_made_is_not_searched_for_garbage_again(domain: int) -> None:
    code = """
import gc, sys
from dataclasses import dataclass
from flea_diag.wire.bus import Program, run
@dataclass(frozen=True)
class Nothing: pass
kept = []
def start(bus, parameters):
    kept.extend([k] for k in range(100_000))
    bus.every(0.01, lambda: bus.info(f"spared: {gc.get_freeze_count() > len(kept)}"))
sys.exit(run(lambda: Program("spared", "", Nothing, start)))
"""
    with Process([sys.executable, "-c", code], domain) as process:
        assert "spared: True" in process.wait_for("spared: ")
        assert process.signal(INT) == 0


@pytest.mark.parametrize("number", [INT, TERM])
def test_a_signal_that_reaches_a_thread_of_a_library_ends_the_node_in_order(
    domain: int, number: signal.Signals, tmp_path: Path
) -> None:
    """That of a BLAS begins with the import of numpy, before any handler is in place."""
    module = ["-c", "import threading, time, sys;"
              "threading.Thread(target=time.sleep, args=(1e6,), daemon=True).start();"
              "from flea_diag.nodes.main import main; sys.exit(main(['recorder']))"]  # fmt: skip
    with Process([sys.executable, *module], domain, cwd=tmp_path) as process:
        process.wait_for(f"recording {len(TOPICS)} topics")
        assert process.signal(number) == 0
    assert "\nrecorder: " in process.output, "its bag was closed"


@pytest.mark.parametrize("number", [INT, TERM])
def test_a_node_that_never_gets_ready_ends_all_the_same(
    domain: int, number: signal.Signals
) -> None:
    """Its main thread waits in the system, as in a compiler: no handler of Python is called."""
    with Process(toy("-p", "busy:=true"), domain) as process:
        process.wait_for("warming up")
        assert process.signal(number) == 0
    assert "Traceback" not in process.output
    assert "ready" not in process.output


@pytest.mark.parametrize("number", [INT, TERM])
def test_a_signal_that_a_launcher_held_back_ends_the_node(
    domain: int, number: signal.Signals
) -> None:
    """It comes before Python has begun, and is delivered once Python has taken it."""
    command = ["env", "--block-signal=INT,TERM", sys.executable]
    module = ["-c", "import os, signal; os.kill(os.getpid(), int(os.environ['SENT']));"
              "from flea_diag.nodes.main import main; main(['recorder'])"]  # fmt: skip
    with Process([*command, *module], domain, SENT=str(int(number))) as process:
        assert process.end() == 0
    assert process.output == ""


def test_an_executable_that_does_not_exist_is_refused(domain: int) -> None:
    with Process([sys.executable, "-m", "flea_diag.nodes.main", "diagnosis"], domain) as process:
        assert process.end() == 2
    assert "no executable 'diagnosis', known are bridge, console, daq" in process.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-p", "limit_a:=41.0"), ["limit_a = 41.0 A", "above its limit 40.0 A"]),
        (("-p", "limit_a:=lots"), ["limit_a = 'lots'", "must be a number"]),
        (("-p", "limit_a:=.nan"), ["limit_a = nan"]),
        (("-p", "fault:=gremlin"), ["fault = 'gremlin'", "choose one of jam, spall"]),
        (("-p", "fualt:=jam"), ["unknown parameter 'fualt'", "known are limit_a, fault"]),
        (("-p", "executor:=multi"), ["executor = 'multi'", "events, single"]),
        (("-p", "fault"), ["ROS refuses the arguments"]),
    ],
)
def test_a_bad_parameter_is_refused_with_one_line(
    domain: int, arguments: tuple[str, ...], words: list[str]
) -> None:
    with Process(toy(*arguments), domain) as process:
        assert process.end() == 2
    lines = [line for line in process.output.splitlines() if "[rcl]" not in line]
    assert len(lines) == 1, process.output
    for word in words:
        assert word in lines[0]


def test_an_integer_will_do_where_a_float_is_meant(domain: int) -> None:
    command = toy("-p", "limit_a:=7", "-p", "use_sim_time:=false")
    with Process(command, domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        peer.find(lambda record: record.node == "toy")
        assert process.signal(INT) == 0
    assert "flea_diag:" not in process.output


def test_another_argument_is_refused(domain: int) -> None:
    with Process([*toy(), "--fault=jam"], domain) as process:
        assert process.end() == 2
    assert "unknown argument '--fault=jam'" in process.output


NODES = ("observer", "isolator", "extractor", "diagnoser", "recorder", "console")


@pytest.mark.parametrize("name", NODES)
def test_help_says_topics_parameters_and_examples(name: str) -> None:
    """What ``--help`` prints; every executable is started with it in ``test_installation.py``."""
    said = usage(program_of(name))
    assert f"ros2 run flea_diag {name}" in said
    for word in ("subscribes:", "parameters", "executor", "examples:", "/msg/"):
        assert word in said


def test_help_into_a_pipe_that_is_closed_early_is_no_error() -> None:
    child = subprocess.Popen(
        [*toy(), "--help"], env=environment(0), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdout is not None
    child.stdout.close()
    _, errors = child.communicate()
    assert (child.returncode, errors) == (0, b"")


@pytest.fixture
def without_ros(tmp_path: Path) -> str:
    (tmp_path / "rclpy.py").write_text("raise ImportError('no rclpy here')\n", encoding="utf-8")
    return f"{tmp_path}:{ROOT}"


def test_without_ros_help_works_and_a_start_says_what_to_install(without_ros: str) -> None:
    def done(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*toy(), *arguments],
            env={**environment(0), "PYTHONPATH": without_ros},
            capture_output=True,
            text=True,
            check=False,
        )

    assert done("--help").returncode == 0
    refused = done()
    assert refused.returncode == 2
    assert "pip install" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
