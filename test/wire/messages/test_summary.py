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

"""The size of a verdict: small with any number of faults, and nothing of it lost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.live import ROOT

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.errors import WireError
from flea_diag.tools.replay.replay import diagnosed, sources
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import BagReader, read_bag
from flea_diag.wire.messages import codec
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.topics import DIAGNOSTIC_ARRAY

NOW_NS = 1_700_000_000 * 10**9
BAGS = sorted(path.parent for path in (ROOT / "bags").glob("*/metadata.yaml"))
EVIDENCE = r.Evidence(
    NOW_NS, "parity_mechanical", "++", "+0", "observed ++, predicted +0", "a -> b"
)
REASON = "parity_mechanical: observed ++, predicted +0, likelihood ratio 12.4 of at least 6.9"
OFFSETS = tuple(
    r.UnitOffset(name, -0.31341504715067775, 0.014289440575609288, NOW_NS)
    for name in ("current_offset_a", "voltage_offset_v")
)
COUNTERS = tuple((f"sensors/slow/{name}", 123456) for name in ("lost", "late", "duplicate"))


def group(*names: str) -> r.AmbiguityGroup:
    """A verdict with everything that a stand can add to it, and all these faults possible."""
    members = tuple(
        r.Candidate(
            name, f"{name}+ | {name}-", 1 / len(names), REASON, (EVIDENCE,) * 4, 0.1, 0.02, "N"
        )
        for name in names
    )
    listed = ", ".join(names)
    return r.AmbiguityGroup(
        NOW_NS, r.Outcome.DETECTED, 12, 34, 10**6, members,
        (r.Candidate("dropped_fault", "", 0.0, REASON, (EVIDENCE,) * 4),),
        NOW_NS, f"fault detected, one of: {listed}", "a" * 64, "replay",
        (("spall", "shows only in vibration"),), ("accelerometer_2_crest",) * 3, 13, True,
        (r.NextTest("motion", "a stroke under load", 30.0, 1.5, (f"{names[0]} / {names[-1]}",)),),
        "parity_mechanical_dn: z = 6.747, limit 6.744, mean of 200 samples", OFFSETS, COUNTERS,
    )  # fmt: skip


def catalogue() -> tuple[str, ...]:
    """Every fault of the shipped catalogue, on a stand with all channels."""
    return tuple(knowledge(load_stand(), learned(load_stand())).faults)


def synthetic(count: int) -> tuple[str, ...]:
    return tuple(f"actuator_position_fault_{number:03}" for number in range(count))


@pytest.mark.parametrize(
    ("named", "limit"),
    [(catalogue, 4096), (lambda: synthetic(200), 8192), (lambda: ("jam",), 4096)],
    ids=["catalogue", "200", "one"],
)
def test_every_member_is_named_within_the_size(
    named: Callable[[], tuple[str, ...]], limit: int
) -> None:
    names = named()
    brief = summary(group(*names), "a_stand_of_a_long_name")
    data = codec.encode(brief, "a_stand_of_a_long_name")
    assert len(data) <= limit
    read = codec.decode(r.AmbiguityGroup, data)
    assert tuple(member.fault for member in read.members) == names
    told = [member.reason for member in read.members]
    count = sum(map(bool, told))
    assert told == [REASON] * count + [""] * (len(names) - count)
    assert (read.summary, read.dropped_count, read.not_observable_count) == (True, 1, 1)
    listed = f": {names[0]}" if len(names) == 1 else f" {len(names)} faults"
    assert read.words == f"fault detected, one of{listed}"


def test_the_shipped_catalogue_has_reasons_for_the_first_members() -> None:
    names = catalogue()
    assert len(names) == 68
    told = [member.reason for member in summary(group(*names)).members]
    assert told[0] == REASON


def test_a_reason_more_would_not_fit() -> None:
    names = synthetic(40)
    whole = group(*names)
    brief = summary(whole)
    count = sum(bool(member.reason) for member in brief.members)
    assert 0 < count < 40
    one_more = (*brief.members[:count], replace(whole.members[count], evidence=()))
    larger = replace(brief, members=(*one_more, *brief.members[count + 1 :]))
    assert len(codec.encode(larger)) > 4000


def test_hypotheses_complete_their_verdict_and_no_other() -> None:
    whole = group("jam", "spall")
    brief, found = summary(whole), whole.hypotheses()
    read = codec.decode(r.Hypotheses, codec.encode(found))
    assert repr(read) == repr(found)
    assert brief.with_hypotheses(read) == whole
    assert brief.with_hypotheses(None) is brief
    assert brief.with_hypotheses(replace(read, step=35)) is brief
    assert brief.with_hypotheses(replace(read, outcome=r.Outcome.ISOLATED)) is brief
    assert brief.with_hypotheses(replace(read, members=read.members[:1])) is brief
    assert whole.with_hypotheses(replace(read, members=())) is whole
    repeated = replace(brief, seq=99, stale=True)
    assert repeated.with_hypotheses(read) == replace(whole, seq=99, stale=True)


@pytest.mark.parametrize("kind", [r.AmbiguityGroup, r.Hypotheses])
def test_every_value_stands_alone(kind: type) -> None:
    """Any viewer reads it: no JSON within a text, and nothing that is not known."""
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    whole = replace(group("jam", "spall"), next_tests=group("jam").next_tests)
    bare = replace(whole.members[1], size=math.nan, size_sigma=math.nan, size_unit="")
    whole = replace(whole, members=(whole.members[0], bare))
    record: Any = summary(whole) if kind is r.AmbiguityGroup else whole.hypotheses()
    array = store.deserialize_cdr(codec.encode(record), DIAGNOSTIC_ARRAY)
    pairs = [(pair.key, pair.value) for status in array.status for pair in status.values]
    assert not [pair for pair in pairs if pair[1][:1] in ("{", "[")]
    assert not [pair for pair in pairs if pair[1] in ("", "nan")]
    keys = dict(pairs)
    if kind is r.Hypotheses:
        assert keys["evidence/4/source"] == "parity_mechanical"
        assert keys["next_tests/1/splits/1"] == "jam / jam"
    else:
        assert keys["offsets/1/value"] == "-0.31341504715067775"
        assert keys["features_computed/1"] == "accelerometer_2_crest"


def test_a_fault_whose_name_would_split_the_list_is_refused() -> None:
    whole = group("jam, spall")
    with pytest.raises(WireError, match="is no name"):
        codec.decode(r.Hypotheses, codec.encode(whole.hypotheses()))
    with pytest.raises(WireError, match="status of 'jam, spall', which is not in the list"):
        codec.decode(r.AmbiguityGroup, codec.encode(whole))


@pytest.mark.parametrize("bag", BAGS, ids=lambda bag: bag.name)
def test_each_verdict_of_the_bags_is_small(bag: Path) -> None:
    said = diagnosed(BagReader(bag).blocks(sources()), make_pipeline(load_stand()))
    groups = [record for record in said if isinstance(record, r.AmbiguityGroup)]
    assert groups
    for whole in groups:
        brief = summary(whole)
        data = codec.encode(brief)
        assert len(data) <= 4096
        read = codec.decode(r.AmbiguityGroup, data).with_hypotheses(
            codec.decode(r.Hypotheses, codec.encode(whole.hypotheses()))
        )
        assert repr(read) == repr(whole)


def test_a_bag_of_the_format_with_json_is_read() -> None:
    """Recorded before hypotheses were a topic: the verdict holds all, evidence as JSON."""
    groups = [
        record
        for _, record in read_bag(ROOT / "bags" / "live_motor_current_bias", (r.AmbiguityGroup,))
        if isinstance(record, r.AmbiguityGroup)
    ]
    last = groups[-1]
    assert not last.summary
    assert [member.fault for member in last.members] == ["motor_current_bias"]
    assert len(last.dropped) == 65
    first = last.members[0].evidence[-1]
    assert (first.source, first.observed, first.predicted) == ("parity_mechanical_dn", "+0", "+*")
    assert [offset.parameter for offset in last.offsets] == ["current_offset_a", "voltage_offset_v"]
