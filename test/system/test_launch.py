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

"""The launch files, run with real nodes by a stand-in for ``ros2 launch``, which is not on PyPI.

What the stand-in does is said in ``support/programs/launch_stand_in.py``. Where the real `launch`
and `launch_ros` are installed, the descriptions are built with those as well.
"""

from __future__ import annotations

import ast
import os
import runpy
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.decisions import BAGS
from support.live import ROOT, Peer, Process, children
from support.prefix import launched, source_prefix

from flea_diag.wire.bus.stand_bus import StandBus
from flea_diag.wire.parameters import descriptors
from flea_diag.wire.records import AmbiguityGroup, Outcome

FILES = ("stand.launch.py", "replay.launch.py")
ALLOWED = {"launch", "launch_ros", "ament_index_python"}
LIMIT_S = 120.0


@pytest.fixture
def prefix(tmp_path: Path) -> str:
    return source_prefix(tmp_path / "prefix")


def executables(pid: int) -> dict[str, int]:
    """Nodes that a launch has started: name -> process id."""
    return dict(executables_of(pid))


def executables_of(pid: int) -> Iterator[tuple[str, int]]:
    """The same where a name may occur twice."""
    for child in children(pid):
        words = Path(f"/proc/{child}/cmdline").read_bytes().decode().split("\0")
        if "flea_diag.nodes.main" in words:
            yield words[words.index("flea_diag.nodes.main") + 1], child


def gone(pid: int) -> bool:
    return not Path(f"/proc/{pid}").exists()


# --- arguments ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "arguments", "words"),
    [
        ("stand.launch.py", ["fault:=foo"], ["fault:=foo", "unknown fault", "jam"]),
        ("stand.launch.py", ["record:=maybe"], ["record:=maybe", "true or false"]),
        ("replay.launch.py", [], ["missing required argument 'bag'"]),
    ],
)
def test_a_bad_argument_is_one_line_and_nothing_is_started(
    domain: int, prefix: str, file: str, arguments: list[str], words: list[str]
) -> None:
    with Process(launched(file, *arguments), domain, AMENT_PREFIX_PATH=prefix) as process:
        assert process.end() == 1
    lines = process.output.splitlines()
    assert len(lines) == 1, process.output
    for word in words:
        assert word in lines[0]
    assert "process started" not in process.output


BY_THE_FILE = [
    (["stand:=false"], ["stand:=false is no stand", "simulated:=false"]),
    (["duration_s:=abc"], ["duration_s:=abc", "not a finite number"]),
    (["duration_s:=nan"], ["duration_s:=nan", "not a finite number"]),
    (["sceanrio:=jam"], ["sceanrio:=jam", "did you mean scenario?"]),
    (["on_failure:=no"], ["on_failure:=no", "stand, launch, restart"]),
    (["log_level:=loud"], ["log_level:=loud", "debug, info"]),
    (["params_file:=no.yaml"], ["params_file:=no.yaml: no such file"]),
]
"""Arguments that the launch file itself refuses, and in what words."""
FEWEST = ["record:=false", "console:=false"]
"""Without the nodes that have no say: each is a process, which checks the same every time."""
BY_A_NODE = [
    (["calibration:=no.yaml", "simulated:=false", *FEWEST], ["calibration:=no.yaml", "no such"]),
    (["duration_s:=-1", *FEWEST], ["duration_s = -1.0 s", "below its limit"]),
    (["stand:=cranfield", *FEWEST], ["stand:=cranfield: machine", "simulated:=false"]),
    (["bag:={here}"], ["bag:={here}", "exists", "name a new bag"]),
]
"""Those that a node refuses when it is asked to check them; of each kind of node one, and where the
file says it in other words."""


@pytest.mark.parametrize(("arguments", "words"), [*BY_THE_FILE, *BY_A_NODE])
def test_what_is_refused_is_named_by_its_argument(
    stood_in: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: Any, words: Any
) -> None:
    file, here = ROOT / "launch" / "stand.launch.py", str(tmp_path)
    given = [each.format(here=here) for each in arguments]
    monkeypatch.setattr(sys, "argv", ["ros2 launch", str(file), *given])
    described, context = stood_in["description_of"](file), stood_in["Context"]()
    for each in described.entities[:-1]:
        context.launch_configurations[each.name] = each.default_value or ""
    context.launch_configurations |= dict(each.split(":=", 1) for each in given)
    with pytest.raises(RuntimeError) as refused:
        described.entities[-1].function(context)
    for word in words:
        assert word.format(here=here) in str(refused.value)


# --- life and end -------------------------------------------------------------------------


def test_the_stand_ends_by_itself_with_the_right_verdict(
    domain: int, prefix: str, tmp_path: Path
) -> None:
    command = launched(
        "stand.launch.py", "fault:=motor_current_bias", "fault_onset_s:=4", "duration_s:=12",
        f"bag:={tmp_path / 'bag'}",
    )  # fmt: skip
    with (
        Process(command, domain, AMENT_PREFIX_PATH=prefix) as process,
        Peer(domain) as peer,
    ):
        peer.bus.subscribe(AmbiguityGroup, peer.records.append)
        process.wait_for("process started", LIMIT_S)
        last = peer.find(lambda r: r.stale, LIMIT_S)
        started = executables(process.child.pid)
        assert process.end() == 0, process.output
    assert {"diagnoser", "recorder", "console"} <= set(started)
    assert all(map(gone, started.values()))
    assert "motor_current_bias" in [member.fault for member in last.members]
    assert last.outcome in (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE, Outcome.DETECTED)
    assert (tmp_path / "bag" / "metadata.yaml").is_file()


@pytest.mark.in_turn(2)
def test_a_replay_with_separate_nodes_ends_by_itself(domain: int, prefix: str) -> None:
    command = launched(
        "replay.launch.py", f"bag:={BAGS / 'jam'}", "rate:=2.0", "composed:=false", "console:=false"
    )
    with Process(command, domain, AMENT_PREFIX_PATH=prefix) as process:
        assert process.end() == 0, process.output
    assert "ISOLATED: the fault is jam" in process.output, process.output
    assert "records played" in process.output


def test_a_node_that_fails_ends_the_launch_with_status_1(domain: int, prefix: str) -> None:
    command = launched("stand.launch.py", "record:=false")
    with Process(command, domain, AMENT_PREFIX_PATH=prefix) as process:
        process.wait_for("NOMINAL", LIMIT_S)
        started = executables(process.child.pid)
        os.kill(started["diagnoser"], signal.SIGKILL)
        assert process.end() == 1
    assert "diagnoser ended with status -9" in process.output
    assert set(started) == {"diagnoser", "console", "daq"}
    assert all(map(gone, started.values()))


ROBOT = """
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def arm(name, **more):
    given = {{"namespace": name, "record": "false", "bag": "", **more}}
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource({file!r}), launch_arguments=given.items()
    )


def generate_launch_description():
    return LaunchDescription([arm("left"), arm("right", console="false")])
"""


@pytest.mark.in_turn(2)
def test_in_a_larger_launch_a_stand_ends_alone_a_viewer_comes_again_and_ctrl_c_ends_all(
    domain: int, prefix: str, tmp_path: Path
) -> None:
    """The file of the robot has an argument that no stand knows, and a node's parameters."""
    robot, file = tmp_path / "robot.launch.py", ROOT / "launch" / "stand.launch.py"
    robot.write_text(ROBOT.format(file=str(file)), encoding="utf-8")
    parameters = tmp_path / "parameters.yaml"
    parameters.write_text("/left/daq: {ros__parameters: {seed: 77}}", encoding="utf-8")
    command = launched(str(robot), "robot:=r2", f"params_file:={parameters}", "log_level:=warn")
    with Process(command, domain, AMENT_PREFIX_PATH=prefix) as process, Peer(domain) as peer:
        seen: dict[str, AmbiguityGroup] = {}
        for name in ("left", "right"):
            bus = StandBus(peer.bus, name)
            bus.subscribe(AmbiguityGroup, lambda record, name=name: seen.update({name: record}))
        peer.until(lambda: len(seen) == 2, LIMIT_S)
        (console,) = (pid for name, pid in started(process) if name == "console")
        os.kill(console, signal.SIGKILL)
        process.wait_for("console ended with status -9 and is started again", LIMIT_S)
        peer.until(lambda: "console" in dict(started(process)), LIMIT_S)
        left = next(pid for name, pid in started(process) if named(pid, "left", "diagnoser"))
        os.kill(left, signal.SIGKILL)
        process.wait_for("diagnoser ended with status -9, which ends the nodes", LIMIT_S)
        peer.until(lambda: not any(named(pid, "left") for _, pid in started(process)), LIMIT_S)
        before = seen["right"].seq
        peer.until(lambda: seen["right"].seq > before + 1 and not seen["right"].stale, LIMIT_S)
        last = executables(process.child.pid)
        assert set(last) == {"diagnoser", "daq"}
        process.read()
        before_the_end, process.output = process.output, ""
        assert process.signal(signal.SIGINT) == 0
    assert all(map(gone, last.values()))
    for word in ("Traceback", "escalating", "rosout", "ended with code -"):
        assert word not in process.output
    process.output = before_the_end + process.output
    assert "seed 77" not in process.output  # below the level that was asked for
    assert "listening to" not in process.output


def started(process: Process) -> list[tuple[str, int]]:
    """Name of the executable and process id of each node that a launch has running."""
    return list(executables_of(process.child.pid))


def named(pid: int, *words: str) -> bool:
    """Whether the command line of a process holds these words."""
    line = Path(f"/proc/{pid}/cmdline").read_bytes().decode()
    return all(word in line for word in words)


# --- what is in the files -----------------------------------------------------------------


@pytest.fixture
def stood_in(monkeypatch: pytest.MonkeyPatch, prefix: str) -> Any:
    """The stand-in's modules in place of launch."""
    program = runpy.run_path(str(ROOT / "test/support/programs/launch_stand_in.py"))
    for name, module in program["stand_in_modules"]().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setenv("AMENT_PREFIX_PATH", prefix)
    return program


@pytest.mark.parametrize("name", FILES)
def test_every_argument_is_explained_and_used(stood_in: Any, name: str) -> None:
    described = stood_in["description_of"](ROOT / "launch" / name)
    declared = [each for each in described.entities if hasattr(each, "default_value")]
    arguments = runpy.run_path(str(ROOT / "launch" / name))["ARGUMENTS"]
    assert all(each.description for each in declared)
    words = {
        node.value
        for node in ast.walk(ast.parse((ROOT / "launch" / name).read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert {row[0] for row in arguments} <= words
    common = runpy.run_path(str(ROOT / "launch" / "checked.py"))["COMMON"]
    assert [each.name for each in declared] == [row[0] for row in (*arguments, *common)]


@pytest.mark.parametrize(("name", "composed"), list(zip(FILES, ("true", "false"), strict=True)))
def test_nodes_and_parameters_exist(stood_in: Any, name: str, composed: str) -> None:
    from flea_diag.nodes.executables import program_of

    described = stood_in["description_of"](ROOT / "launch" / name)
    context = stood_in["Context"]()
    for each in described.entities[:-1]:
        context.launch_configurations[each.name] = each.default_value or ""
    context.launch_configurations["composed"] = composed
    context.launch_configurations["bag"] = str(BAGS / "jam") if "replay" in name else ""
    *nodes, _ = described.entities[-1].function(context)
    assert len(nodes) >= 3
    for node in nodes:
        assert node.package == "flea_diag"
        known = program_of(node.executable).parameters
        names = {entry.name for entry in descriptors(known)} | {"use_sim_time"}
        for parameters in node.parameters:
            assert set(parameters) <= names


@pytest.mark.parametrize("name", FILES)
def test_the_description_is_built_by_the_real_launch(name: str) -> None:
    pytest.importorskip("launch_ros", reason="launch and launch_ros come with ROS, not from PyPI")
    made = runpy.run_path(str(ROOT / "launch" / name))["generate_launch_description"]()
    assert made.entities


def test_nothing_but_launch_and_the_standard_library_is_imported() -> None:
    """A launch file may run in a Python that does not have our package."""
    modules = set()
    for path in (ROOT / "launch").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                modules.add((node.module or "").split(".")[0])
            elif isinstance(node, ast.Import):
                modules |= {alias.name.split(".")[0] for alias in node.names}
    assert modules - set(sys.stdlib_module_names) == ALLOWED
