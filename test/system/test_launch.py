"""The launch files: `launch` is not on PyPI, so this is what can be held without it.

They are executed against stand-ins that keep what they are given (no behaviour is copied), and
held against our own programs: executables, parameters and topics must exist. Where the real
`launch` and `launch_ros` are installed, the descriptions are built with those as well.
"""

from __future__ import annotations

import ast
import runpy
import sys
from types import ModuleType
from typing import Any

import pytest
from support.live import ROOT

from flea_diag.wire.parameters import descriptors
from flea_diag.wire.topics import TOPIC_NAMED

FILES = ("stand.launch.py", "replay.launch.py")


class Kept:
    """What a launch file made: its class by name and everything it was given."""

    def __init__(self, kind: str, args: tuple[Any, ...], given: dict[str, Any]) -> None:
        self.kind, self.args, self.given = kind, args, given


class StandIn(ModuleType):
    """A module that has every class, each of which makes a ``Kept``."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *args, **given: Kept(name, args, given)


@pytest.fixture
def without_launch(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (
        "launch", "launch.actions", "launch.conditions", "launch.substitutions",
        "launch_ros", "launch_ros.actions", "launch_ros.parameter_descriptions",
    ):  # fmt: skip
        monkeypatch.setitem(sys.modules, module, StandIn(module))


def entries(name: str) -> list[Kept]:
    made = runpy.run_path(str(ROOT / "launch" / name))["generate_launch_description"]()
    assert made.kind == "LaunchDescription"
    return list(made.args[0])


def imported_names(name: str) -> set[tuple[str, str]]:
    tree = ast.parse((ROOT / "launch" / name).read_text(encoding="utf-8"))
    return {
        (node.module or "", alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


@pytest.mark.parametrize("name", FILES)
def test_every_node_is_an_executable_of_ours(without_launch: None, name: str) -> None:
    nodes = [entry.given for entry in entries(name) if entry.kind == "Node"]
    assert nodes
    for given in nodes:
        assert given["package"] == "flea_diag"
        assert (ROOT / "launcher" / given["executable"]).is_file()


def test_the_parameters_given_exist(without_launch: None) -> None:
    from flea_diag import configuration
    from flea_diag.nodes.recording.recorder import RecorderParameters
    from flea_sim_driver.daq_node import DaqParameters

    stages = ("observer", "isolator", "extractor", "diagnoser")
    known = {
        **{
            name: {
                entry.name for entry in descriptors(getattr(configuration, name.upper()).parameters)
            }
            for name in stages
        },
        "daq": {entry.name for entry in descriptors(DaqParameters)},
        "recorder": {entry.name for entry in descriptors(RecorderParameters)},
    }
    given = {
        entry.given["executable"]: set().union(*entry.given["parameters"])
        for entry in entries("stand.launch.py")
        if entry.kind == "Node" and entry.given["parameters"]
    }
    assert set(given) == set(known)
    for executable, names in given.items():
        assert names <= known[executable]


@pytest.mark.parametrize("name", FILES)
def test_every_argument_used_is_declared_and_explained(without_launch: None, name: str) -> None:
    declared = [entry for entry in entries(name) if entry.kind == "DeclareLaunchArgument"]
    tree = ast.parse((ROOT / "launch" / name).read_text(encoding="utf-8"))
    used = {
        call.args[0].value
        for call in ast.walk(tree)
        if isinstance(call, ast.Call)
        and getattr(call.func, "id", "") == "LaunchConfiguration"
        and isinstance(call.args[0], ast.Constant)
    }
    names = {entry.args[0] for entry in declared}
    assert used <= names
    assert all(entry.given["description"] for entry in declared)


def test_a_replay_plays_only_what_a_stand_sends(without_launch: None) -> None:
    sources = runpy.run_path(str(ROOT / "launch" / "replay.launch.py"))["SOURCES"]
    assert set(sources) <= set(TOPIC_NAMED)
    assert "ambiguity_group" not in sources


@pytest.mark.parametrize("name", FILES)
def test_the_description_is_built_by_the_real_launch(name: str) -> None:
    pytest.importorskip("launch_ros", reason="launch and launch_ros come with ROS, not from PyPI")
    made = runpy.run_path(str(ROOT / "launch" / name))["generate_launch_description"]()
    assert made.entities


def test_nothing_but_launch_is_imported() -> None:
    modules = {module.split(".")[0] for name in FILES for module, _ in imported_names(name)}
    assert modules == {"launch", "launch_ros"}
