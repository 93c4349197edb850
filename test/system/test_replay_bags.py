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

"""The bags of the project, through `flea replay` and through real nodes: the same decisions.

``bags/make.py`` makes the bags and renews what is expected of them.
"""

from __future__ import annotations

import json
import runpy
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from support import in_turn
from support.decisions import BAGS, DECIDED, NAMES, decisions, expected
from support.flight import SOURCES, Flight
from support.live import Peer, Process, node

from flea_diag.stages.digest import digest
from flea_diag.tools.main import main
from flea_diag.tools.replay.recorded import RECORDED, completed
from flea_diag.tools.replay.summary import summarise
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import (
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Record,
    Residual,
    Scan,
    Symbols,
    Truth,
)

LIVE = [name for name in NAMES if name.startswith("live_")]
FEATURE = "jam"
"""The bag with vibration, in which a feature splits the group: all three stages have work."""

LARGEST_BYTES = 1_000_000
RATE = 2.0
"""Times real time for nodes of which not every one tells how far it is."""
PATIENT = ("-p", "watermark_s:=2.0", "-p", "answer_limit_s:=60.0")
"""An isolator that nobody waits for, on a machine that may be busy, twice as fast as a stand."""
FLIGHTS = 4
"""Where a busy machine holds up this process for longer than a source may be silent, nodes let go,
as they should live, what they hold back. Bits are promised to a flight without such a pause."""
BETWEEN_NODES = (*SOURCES, Scan, Residual, Detection, Symbols, FeatureRequest, FeatureValue)
"""What three separate nodes hear: two of them scans, and one of them what another says."""
Summaries = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Summaries:
    """JSON of `flea replay` of all bags in one go."""
    return replay_all(NAMES, tmp_path_factory.mktemp("replayed"))


def replay_all(names: list[str], folder: Path) -> Summaries:
    """Run the command over these bags; its JSON by the name of the bag."""
    bags = [str(BAGS / name) for name in names]
    assert main(["replay", *bags, "-q", "--json", f"{folder}/"]) == 0
    return {name: json.loads((folder / f"{name}.json").read_text("utf-8")) for name in names}


def sources(name: str) -> list[Record]:
    """What the stand said in a bag, in the order of the recording."""
    return [record for _, record in BagReader(BAGS / name).records(SOURCES)]


def test_every_bag_is_small_and_has_its_decisions() -> None:
    made = runpy.run_path(str(BAGS / "make.py"))
    assert sorted([*made["SIMULATED"], *made["LIVE"]]) == NAMES
    assert len(NAMES) >= 5
    assert LIVE
    for name in NAMES:
        assert sum(file.stat().st_size for file in (BAGS / name).iterdir()) <= LARGEST_BYTES, name


@pytest.mark.parametrize("name", NAMES)
def test_what_is_expected_is_true(name: str) -> None:
    """The decisions stored are no record of a mistake: they hold against the bag's own truth."""
    bag = BagReader(BAGS / name)
    truths = [record for _, record in bag.records((Truth,)) if isinstance(record, Truth)]
    start_ns = next(record.stamp_ns for _, record in bag.records((Scan,)))
    told = expected(name)
    faults = [truth for truth in truths if truth.fault != "nominal"]
    if not faults:
        assert (told["outcome"], told["episodes"]) == ("NOMINAL", [])
    for fault in faults:
        assert told["detected_at_s"] >= (fault.onset_ns - start_ns) / 1e9
        assert fault.fault in told["ambiguity_group"]
        assert len(told["ambiguity_group"]) <= 3


@pytest.mark.parametrize("name", NAMES)
def test_replay_gives_the_expected_decisions(name: str, replayed: Summaries) -> None:
    told = expected(name)
    assert decisions(replayed[name]) == {key: told[key] for key in (*DECIDED, "episodes")}
    if replayed[name]["backend"] == told["backend"]:
        assert replayed[name]["decision_digest"] == told["decision_digest"]


def test_two_replays_give_the_same_digest(replayed: Summaries, tmp_path: Path) -> None:
    for name, again in replay_all([*LIVE, FEATURE], tmp_path).items():
        assert again["digest"] == replayed[name]["digest"]


@pytest.mark.parametrize("name", LIVE)
def test_a_replay_decides_what_was_published_live(name: str, replayed: Summaries) -> None:
    kinds = (*SOURCES, DataQuality, *RECORDED)
    published = completed(record for _, record in BagReader(BAGS / name).records(kinds))
    assert decisions(summarise(published)) == decisions(replayed[name])


# --- through nodes ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def module_domain(compiled: None) -> Iterator[int]:
    """One domain for all flights through the composed node."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    from flea_diag.nodes.run.domain import reserved_domain

    with reserved_domain() as number:
        yield number


@pytest.fixture(scope="module")
def composed(module_domain: int) -> Iterator[Flight]:
    """The diagnoser, all three stages in one process, which sees one bag after the other."""
    with (
        Process(node("diagnoser", "-p", "memory:=none"), module_domain),
        Peer(module_domain) as peer,
    ):
        yield Flight(peer)


def agree(flown: list[Record], summary: dict[str, Any], name: str) -> None:
    """Nodes and replay decided the same, to the last bit, and what was expected."""
    told = expected(name)
    assert decisions(summarise(flown)) == {key: told[key] for key in (*DECIDED, "episodes")}
    assert digest(flown) == summary["digest"]


@pytest.mark.parametrize("name", in_turn(NAMES, 2))
def test_the_composed_node_decides_the_same(
    name: str, composed: Flight, replayed: Summaries
) -> None:
    for _ in range(FLIGHTS):
        flown = composed.fly(sources(name))
        if digest(flown) == replayed[name]["digest"]:
            break
    agree(flown, replayed[name], name)


def test_separate_nodes_decide_the_same(domain: int, replayed: Summaries) -> None:
    with ExitStack() as running:
        for part, told in (("observer", ()), ("isolator", PATIENT), ("extractor", ())):
            running.enter_context(Process(node(part, *told), domain))
        flight = Flight(running.enter_context(Peer(domain)), BETWEEN_NODES)
        records = sources(FEATURE)
        flight.introduce(next(record for record in records if isinstance(record, Scan)))
        for _ in range(FLIGHTS):
            flown = flight.fly(records, RATE)
            if digest(flown) == replayed[FEATURE]["digest"]:
                break
        agree(flown, replayed[FEATURE], FEATURE)
