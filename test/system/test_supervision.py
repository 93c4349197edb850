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

"""The shipped systemd units and container recipe: what they start hears the signal that ends it."""

from __future__ import annotations

import json
import re
import signal
from configparser import RawConfigParser
from pathlib import Path

import pytest
from support.live import ROOT, Process, children
from support.prefix import source_prefix

from flea_diag.nodes.executables import EXECUTABLES

FOLDER = ROOT / "config" / "supervision"
UNITS = sorted(path.name for path in FOLDER.glob("*.service"))
STAND = ROOT / "config" / "stands" / "joint"
INSTALLED = "/opt/flea_diag"
READY = {"diagnoser": "listening to /left_arm/", "bridge": "bridging /joint_states",
         "recorder": "recording "}  # fmt: skip


def unit(name: str) -> RawConfigParser:
    """A unit as systemd reads it: a key may occur twice."""
    made = RawConfigParser(strict=False)
    made.optionxform = str  # type: ignore[assignment, method-assign]
    made.read(FOLDER / name, encoding="utf-8")
    return made


def command(text: str, prefix: str, stand: Path = STAND) -> list[str]:
    """Words that systemd executes, without a shell, for the instance left_arm."""
    there = text.replace("/etc/flea_diag/%i", str(stand)).replace("%i", "left_arm")
    return there.replace(INSTALLED, prefix.split(":")[0]).split()


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_starts_a_node_that_ends_by_sigterm_alone(
    name: str, domain: int, tmp_path: Path
) -> None:
    service = unit(name)["Service"]
    assert (service["KillSignal"], service["Type"]) == ("SIGTERM", "exec")
    prefix = source_prefix(tmp_path / "prefix")
    words = command(service["ExecStart"], prefix)
    executable = Path(words[0]).name
    with Process(words, domain, AMENT_PREFIX_PATH=prefix, cwd=tmp_path) as process:
        process.wait_for(READY[executable])
        assert not children(process.child.pid), "no process stands between systemd and the node"
        assert process.signal(signal.SIGTERM) == 0, process.output


def test_what_no_restart_mends_ends_with_the_status_that_prevents_one(
    domain: int, tmp_path: Path
) -> None:
    prefix = source_prefix(tmp_path / "prefix")
    for name in UNITS:
        service = unit(name)["Service"]
        words = command(service["ExecStart"], prefix, tmp_path / "no_such_stand")
        with Process(words, domain, AMENT_PREFIX_PATH=prefix, cwd=tmp_path) as process:
            assert process.end() == int(service["RestartPreventExitStatus"])
        assert process.output.count("\n") == 1
        assert "no such folder" in process.output


def test_the_container_starts_an_executable_in_place_of_its_shell(
    domain: int, tmp_path: Path
) -> None:
    text = (FOLDER / "Containerfile").read_text(encoding="utf-8")
    entry, default = (
        json.loads(re.search(rf"^{key} (\[.*\])$", text, re.MULTILINE)[1])  # type: ignore[index]
        for key in ("ENTRYPOINT", "CMD")
    )
    assert default[0] in EXECUTABLES
    assert re.search("^STOPSIGNAL SIGTERM$", text, re.MULTILINE)
    prefix = source_prefix(tmp_path / "prefix")
    words = [word.replace(INSTALLED, prefix.split(":")[0]) for word in entry]
    given = [*words, "bridge", "--ros-args", "-p", f"stand:={STAND}"]
    with Process(given, domain, AMENT_PREFIX_PATH=prefix, cwd=tmp_path) as process:
        process.wait_for(READY["bridge"])
        line = Path(f"/proc/{process.child.pid}/cmdline").read_bytes().decode()
        assert "flea_diag.nodes.main" in line, "the process that was started is the node itself"
        assert process.signal(signal.SIGTERM) == 0, process.output
