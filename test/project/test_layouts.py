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

"""The layouts and the aggregator's configuration show topics, channels and nodes that exist."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from support.live import ROOT
from support.verdicts import NOMINAL, group

from flea_diag.configuration.description import compiled_relations, faults_of
from flea_diag.operator.state import SHOWN
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.messages.joint_state import KURTOSIS
from flea_diag.wire.messages.verdict_numbers import verdict_numbers
from flea_diag.wire.records import ChannelTable, Outcome, Remark, Scan, Truth
from flea_diag.wire.topics import TOPIC_NAMED, TOPIC_OF
from flea_sim_driver.acquisition.sensors import ACCELEROMETER_AXES

FLEA = compiled_relations("actuator.yaml").residuals
FLEA_FAULTS = faults_of("actuator.yaml", "faults.yaml")

LAYOUTS = ROOT / "config" / "layouts"
FOXGLOVE = json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def wire_names() -> dict[str, tuple[str, ...]]:
    """Names on the wire, in their order, of what the simulated stand and the observer send."""
    bag = ROOT / "bags" / "jam"
    scan = next(r for _, r in read_bag(bag, (Scan,)))
    table = next(r for _, r in read_bag(bag, (ChannelTable,)))
    assert isinstance(scan, Scan)
    assert isinstance(table, ChannelTable)
    axes = [row.name for row in table.channels if row.name.startswith("accelerometer")]
    assert tuple(axes) == ACCELEROMETER_AXES
    parts = tuple(f"{row.name}{part}" for row in FLEA.rows for part in ("", "/z", "/threshold"))
    level = (*axes, *(axis + KURTOSIS for axis in axes))
    verdict = verdict_numbers(NOMINAL).names  # of a healthy stand: those that stand first in any
    names = {"sensors/slow": scan.channels, "residual": parts, "vibration_level": level}
    return {**names, "verdict_numbers": verdict}


def foxglove_paths() -> Iterator[tuple[str, str]]:
    for config in FOXGLOVE["configById"].values():
        for path in config.get("paths", ()):
            yield path["value"], path["label"]


def test_every_foxglove_topic_exists() -> None:
    shown = [value for value, _ in foxglove_paths()]
    shown += [c["topicToRender"] for c in FOXGLOVE["configById"].values() if "topicToRender" in c]
    topics = {value.lstrip("/").partition(".")[0] for value in shown}
    assert topics <= set(TOPIC_NAMED)
    shows = {"ambiguity_group", "verdict_numbers", "sensors/slow", "residual", "diagnostics"}
    assert shows <= topics


def test_every_foxglove_curve_is_the_number_that_its_label_says(
    wire_names: dict[str, tuple[str, ...]],
) -> None:
    numbers = 0
    for value, label in foxglove_paths():
        found = re.fullmatch(r"/(.+)\.position\[(\d+)\]", value)
        if found:
            assert wire_names[found[1]][int(found[2])] == label
            numbers += 1
    assert numbers > 15


def test_the_foxglove_mosaic_holds_each_panel_once() -> None:
    def leaves(part: Any) -> Iterator[str]:
        if isinstance(part, str):
            yield part
            return
        assert part["direction"] in ("row", "column")
        yield from leaves(part["first"])
        yield from leaves(part["second"])

    assert sorted(leaves(FOXGLOVE["layout"])) == sorted(FOXGLOVE["configById"])


def test_every_plotjuggler_curve_exists(wire_names: dict[str, tuple[str, ...]]) -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    estimates = tuple(f"{name}/estimate" for name in wire_names["sensors/slow"])
    possible = verdict_numbers(group(Outcome.DETECTED, *FLEA_FAULTS)).names
    known = {**wire_names, "residual": wire_names["residual"] + estimates}
    known["verdict_numbers"] = possible
    assert curves
    assert {"/verdict_numbers/outcome/position", "/verdict_numbers/members/position"} <= set(curves)
    for curve in curves:
        topic = next(name for name in known if curve.startswith(f"/{name}/"))
        assert curve.removeprefix(f"/{topic}/").removesuffix("/position") in known[topic], curve


def test_plotjuggler_splitters_count_their_areas() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    for splitter in root.iter("DockSplitter"):
        count = int(splitter.attrib["count"])
        assert len(splitter.findall("DockArea")) == count
        assert len(splitter.attrib["sizes"].split(";")) == count


NAMES = (
    "daq", "observer", "isolator", "extractor", "diagnoser", "fault_reporter", "recorder",
    "stand_2/daq", "isolator: verdict", "observer: channels", "stand_2/diagnoser: verdict",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_each_status_has_one_place_in_the_aggregator(name: str) -> None:
    text = (ROOT / "config" / "diagnostic_aggregator.yaml").read_text(encoding="utf-8")
    analyzers = yaml.safe_load(text)["analyzers"]["ros__parameters"]
    places = [
        entry["path"]
        for entry in analyzers.values()
        if isinstance(entry, dict)
        and (
            any(part in name for part in entry.get("contains", ()))
            or any(re.search(pattern, name) for pattern in entry.get("regex", ()))
        )
    ]
    assert len(places) == 1


def test_the_domain_bridge_carries_what_a_page_shows() -> None:
    text = (ROOT / "config" / "domain_bridge.yaml").read_text(encoding="utf-8")
    topics = yaml.safe_load(text)["topics"]
    carried = {name.removeprefix("bay_1/"): row for name, row in topics.items()}
    shown = [TOPIC_OF[kind] for kind in (*SHOWN, Remark) if kind is not Truth]
    assert set(carried) == {topic.name.lstrip("/") for topic in shown}
    for topic in shown:
        row = carried[topic.name.lstrip("/")]
        assert row["type"] == topic.message
        assert row.get("qos", {}).get("depth", 10) >= topic.depth
        assert row.get("bidirectional", False) == (topic.record is Remark)
