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

"""``fleet.launch.py``: stands spread over processes, of which one may be killed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from support.live import Peer, Process, children
from support.prefix import launched, source_prefix

from flea_diag.wire.records import Health

FILE = "fleet.launch.py"


@pytest.fixture
def prefix(tmp_path: Path) -> str:
    return source_prefix(tmp_path / "prefix")


def test_a_process_that_is_killed_comes_back_and_the_others_go_on(
    domain: int, prefix: str, tmp_path: Path
) -> None:
    hosts = tmp_path / "fleet.txt"
    hosts.write_text("# two rooms\npc_1: bay_1 bay_2\npc_2: bay_3\n", encoding="utf-8")
    command = launched(FILE, f"hosts:={hosts}", "host:=pc_1", "processes:=2", "console:=false")
    with Process(command, domain, AMENT_PREFIX_PATH=prefix) as process, Peer(domain) as peer:
        states: dict[str, str] = {}
        peer.bus.subscribe(Health, lambda record: states.update({record.node: record.message}))

        def running(name: str) -> bool:
            return states.get(name) == "1 of 1 stands running"

        # a process says that its stands run before they have said anything themselves
        diagnosers = {"bay_1/diagnoser", "bay_2/diagnoser"}
        peer.until(lambda: running("fleet_1") and running("fleet_2") and diagnosers <= set(states))
        assert "bay_3/diagnoser" not in states
        first = children(process.child.pid)
        states.clear()
        os.kill(first[0], signal.SIGKILL)
        peer.until(lambda: running("fleet_1") and running("fleet_2"))
        assert first[1] in children(process.child.pid)
        assert process.signal(signal.SIGINT) == 0, process.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], 'give either stands:="bay_1 bay_2" or hosts:=FILE'),
        (["stands:=a", "hosts:={hosts}"], 'give either stands:="bay_1 bay_2" or hosts:=FILE'),
        (["hosts:=no.txt"], "hosts:=no.txt cannot be read"),
        (["hosts:={hosts}", "host:=pc_9"], "has no line for host pc_9, but for pc_1"),
        (["stands:=a", "processes:=2"], "processes:=2 must be from 1 to 1"),
        (["stands:=a", "batch_ms:=1.5"], "batch_ms:=1.5 is not a whole number"),
        (["stands:=a a"], "the namespace 'a' occurs twice"),
    ],
)
def test_what_cannot_be_started_is_one_line(
    domain: int, prefix: str, tmp_path: Path, arguments: list[str], words: str
) -> None:
    hosts = tmp_path / "fleet.txt"
    hosts.write_text("pc_1: bay_1\n", encoding="utf-8")
    given = [each.format(hosts=hosts) for each in arguments]
    with Process(launched(FILE, *given), domain, AMENT_PREFIX_PATH=prefix) as process:
        assert process.end() == 1
    (line,) = process.output.splitlines()
    assert words in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pc_1: bay_1\npc_1: bay_2\n", "line 2: host pc_1 has a line already"),
        ("pc_1: bay_1\n\npc_2: bay_2 /bay_1=./mine\n", "line 3: pc_1 has the stand bay_1 already"),
        ("pc_1: bay_1\nbay_2 # host forgotten\n", "line 2: 'bay_2' is not HOST: STANDS"),
    ],
)
def test_a_hosts_file_that_would_lose_or_double_a_stand_is_refused(
    domain: int, prefix: str, tmp_path: Path, text: str, words: str
) -> None:
    hosts = tmp_path / "fleet.txt"
    hosts.write_text(text, encoding="utf-8")
    command = launched(FILE, f"hosts:={hosts}", "host:=pc_1")
    with Process(command, domain, AMENT_PREFIX_PATH=prefix) as process:
        assert process.end() == 1
    (line,) = process.output.splitlines()
    assert words in line
