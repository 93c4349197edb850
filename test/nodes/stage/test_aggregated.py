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

"""What diagnostic_aggregator makes of /diagnostics with the shipped parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from support.live import Peer, Process, toy
from support.neighbours.aggregator import ERROR, OK, STALE, WARN, Aggregator
from support.places import ROOT

from flea_diag.wire.records import ChannelInfo, ChannelTable, Health, Scan

SHIPPED = ROOT / "config" / "diagnostic_aggregator.yaml"
NEEDED = ("diagnoser", "diagnoser: verdict", "diagnoser: channels")
OPTIONAL = ("daq", "bridge", "recorder", "fault_reporter", "fleet", "fleet_2", "numbers")
PERIOD_NS = 10_000_000


def told(*names: str, at_s: float = 0.0) -> Aggregator:
    """The shipped tree after one OK status of each of these names."""
    made = Aggregator(SHIPPED)
    for name in names:
        made.take(name, OK, at_s)
    assert not made.other
    return made


@pytest.mark.parametrize("missing", ["", *OPTIONAL])
def test_a_healthy_stand_is_ok_whatever_optional_node_is_missing(missing: str) -> None:
    names = [name for name in (*NEEDED, *OPTIONAL) if name != missing]
    assert set(told(*names).levels(1.0).values()) == {OK}
    assert set(told(*NEEDED).levels(1.0).values()) == {OK}


@pytest.mark.parametrize("node", OPTIONAL)
def test_an_optional_node_that_was_stopped_is_forgotten(node: str) -> None:
    tree = told(*NEEDED, node)
    for name in NEEDED:
        tree.take(name, OK, 7.0)
    assert set(tree.levels(7.0).values()) == {OK}


@pytest.mark.parametrize("stages", [("diagnoser",), ("observer", "isolator", "extractor")])
def test_a_diagnosis_in_one_process_or_three_is_ok_in_any_namespace(
    stages: tuple[str, ...],
) -> None:
    nodes = [f"stand_2/{name}" for name in stages]
    tree = told(*nodes, f"{nodes[0]}: channels", f"{nodes[-1]}: verdict")
    assert set(tree.levels(1.0).values()) == {OK}


@pytest.mark.parametrize("gone", NEEDED)
def test_what_a_stand_needs_is_an_error_once_it_says_nothing(gone: str) -> None:
    tree = told(*NEEDED)
    for name in NEEDED:
        if name != gone:
            tree.take(name, OK, 7.0)
    assert tree.levels(7.0)["Stand"] == ERROR
    assert sorted(tree.levels(7.0).values()).count(STALE) == 1


def test_nothing_at_all_is_no_ok() -> None:
    assert told().levels(1.0)["Stand"] == ERROR


class Watched:
    """A toy diagnosis under the name of the real one, and the tree of what it says."""

    def __init__(self, peer: Peer) -> None:
        self._peer, self._stamp_ns = peer, 1_700_000_000 * 10**9

    def scan(self, current: float) -> None:
        self._stamp_ns += PERIOD_NS
        self._peer.bus.publish(Scan(self._stamp_ns, ("motor_current",), (current,)))

    def report(self, name: str, words: str, serial: str = "") -> Health:
        """A status of this name that is yet to come, of a machine with this serial number."""
        self._peer.records.clear()
        return self._peer.find(_says(name, words, serial))

    def report_while(self, current: float, name: str, words: str, serial: str = "") -> Health:
        """The same while scans go on: a verdict is repeated no more once they have stopped."""
        said = _says(name, words, serial)
        self._peer.records.clear()
        self._peer.until(lambda: self.scan(current) or any(map(said, self._peer.records)))
        return self._peer.find(said)

    def levels(self) -> dict[str, int]:
        tree = Aggregator(SHIPPED)
        now_s = time.monotonic()
        latest = {r.node: r.level for r in self._peer.records if isinstance(r, Health)}
        for name, level in latest.items():
            tree.take(name, level, now_s)
        return tree.levels(now_s)


def _says(name: str, words: str, serial: str) -> Callable[[Any], bool]:
    return lambda r: (
        isinstance(r, Health) and r.node == name and words in r.message and serial in r.hardware
    )


@pytest.fixture(params=["live", "replay"])
def watched(request: pytest.FixtureRequest, domain: int) -> Iterator[tuple[str, Watched]]:
    given = ("-r", "__node:=diagnoser", "-p", f"source:={request.param}")
    with Process(toy(*given), domain), Peer(domain) as peer:
        peer.listen(Health)
        assert peer.heard(Scan, ChannelTable)
        rows = (ChannelInfo("motor_current", "A", -40.0, 40.0, 100.0, serial="EMA-7"),)
        peer.bus.publish(ChannelTable(1_700_000_000 * 10**9, "toy", rows))
        yield request.param, Watched(peer)


def test_live_and_replayed_verdicts_as_the_aggregator_shows_them(
    watched: tuple[str, Watched],
) -> None:
    source, stand = watched
    before = "" if source == "live" else "replay: "
    waiting = stand.report("diagnoser", "waiting for the first record")
    assert waiting.level == (WARN if source == "live" else OK)
    # The table comes on a topic of its own, and may be taken after the first scans.
    calm = stand.report_while(1.0, "diagnoser: verdict", "nominal", serial="EMA-7")
    assert (calm.level, calm.message) == (OK, f"{before}nominal")
    alarm = stand.report_while(9.0, "diagnoser: verdict", "isolated")
    assert alarm.level == (ERROR if source == "live" else OK)
    assert alarm.message == f"{before}isolated"
    # The source has stopped: the node says so, and its verdict is repeated no more.
    silent = stand.report("diagnoser", "no record for")
    assert silent.level == (WARN if source == "live" else OK)
    stand.report("diagnoser", "no record for")
    assert stand.levels()["Verdict"] == STALE
