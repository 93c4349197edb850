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

"""The codec against three oracles: its own inverse, rosbags' codec and the real rclpy classes."""

from __future__ import annotations

import dataclasses
import math
import struct
from typing import Any, get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import examples

from flea_diag.errors import WireError
from flea_diag.wire import records as r
from flea_diag.wire.messages import cdr, codec, gate
from flea_diag.wire.topics import DIAGNOSTIC_ARRAY, TOPIC_OF, TOPICS

TEXT = st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0"), max_size=12)
STAMP = st.integers(0, (2**31) * 10**9 - 1)
VALUES = {
    str: TEXT,
    int: st.integers(-(2**63), 2**63 - 1),
    float: st.floats(width=64),
    bool: st.booleans(),
    r.Outcome: st.sampled_from(r.Outcome),
    r.Quality: st.sampled_from(r.Quality),
    r.RemarkKind: st.sampled_from(r.RemarkKind),
    r.Level: st.sampled_from(r.Level),
    r.Cause: st.sampled_from(r.Cause),
    tuple[str, ...]: st.lists(TEXT, max_size=4).map(tuple),
    tuple[tuple[str, str], ...]: st.lists(st.tuples(TEXT, TEXT), max_size=3).map(tuple),
    tuple[tuple[str, int], ...]: st.lists(
        st.tuples(TEXT, st.integers(-(2**63), 2**63 - 1)), max_size=3
    ).map(tuple),
}


def judgements(kind: type) -> st.SearchStrategy[Any]:
    """Any value of a dataclass, from the types of its fields."""
    hints = get_type_hints(kind)
    fields = {entry.name: field(hints[entry.name]) for entry in dataclasses.fields(kind)}
    if "stamp_ns" in fields and kind is not r.Evidence:
        fields["stamp_ns"] = STAMP
    return st.builds(kind, **fields)


def field(hint: Any) -> st.SearchStrategy[Any]:
    if hint in VALUES:
        return VALUES[hint]
    return st.lists(judgements(hint.__args__[0]), max_size=3).map(tuple)


def numbers(kind: type, name: st.SearchStrategy[str] = TEXT) -> st.SearchStrategy[Any]:
    rows = st.lists(st.tuples(name, VALUES[float]), max_size=5)
    return st.builds(
        lambda stamp, pairs: kind(stamp, tuple(k for k, _ in pairs), tuple(v for _, v in pairs)),
        STAMP,
        rows,
    )


@st.composite
def levels(draw: st.DrawFn) -> r.VibrationLevel:
    axis = TEXT.filter(lambda text: not text.endswith("/kurtosis"))
    axes = tuple(draw(st.lists(axis, max_size=4)))
    column = st.tuples(*[VALUES[float]] * len(axes))
    return r.VibrationLevel(draw(STAMP), axes, draw(column), draw(column | st.just(())))


@st.composite
def residuals(draw: st.DrawFn) -> r.Residual:
    name = TEXT.map(lambda text: text.replace("/", "_"))
    names = tuple(draw(st.lists(name, max_size=4)))
    regressors = tuple(draw(st.lists(name, max_size=3)))
    column = st.tuples(*[VALUES[float]] * len(names))
    estimated = tuple(draw(st.lists(name, max_size=3)))
    band = st.tuples(*[VALUES[float]] * len(estimated))
    health = st.tuples(*[VALUES[float]] * draw(st.sampled_from((0, 3))))
    return r.Residual(
        draw(STAMP),
        names,
        draw(column),
        draw(column),
        draw(column),
        regressors,
        draw(st.tuples(*[VALUES[float]] * len(regressors))),
        estimated,
        draw(band),
        draw(band),
        draw(health),
    )


@st.composite
def blocks(draw: st.DrawFn) -> r.VibrationBlock:
    axes = tuple(draw(st.lists(TEXT, max_size=4)))
    count = draw(st.integers(0, 5))
    size = count * (4 + 4 * len(axes))
    return r.VibrationBlock(draw(STAMP), axes, count, draw(st.binary(min_size=size, max_size=size)))


RECORDS: dict[type, st.SearchStrategy[Any]] = {
    r.Scan: numbers(r.Scan),
    r.VibrationLevel: levels(),
    r.VerdictNumbers: numbers(r.VerdictNumbers),
    r.Residual: residuals(),
    r.VibrationBlock: blocks(),
    **{row.record: judgements(row.record) for row in TOPICS if row.message == DIAGNOSTIC_ARRAY},
}
RECORDS = {
    kind: strategy.filter(lambda record: passes(record)) for kind, strategy in RECORDS.items()
}
ANY_RECORD = st.one_of(list(RECORDS.values()))


def passes(record: Any) -> bool:
    """Whether the gate lets a record in: the round trip is promised to those."""
    try:
        gate.check(record)
    except WireError:
        return False
    return True


def same(a: Any, b: Any) -> bool:
    """Equality that takes NaN as equal to NaN and 0.0 as different from -0.0."""
    return repr(a) == repr(b)


def test_every_topic_has_a_strategy() -> None:
    assert set(RECORDS) == set(TOPIC_OF)


@pytest.mark.parametrize("kind", RECORDS, ids=lambda kind: kind.__name__)
def test_every_record_reads_back_exactly(kind: type) -> None:
    @settings(max_examples=examples(60), deadline=None)
    @given(RECORDS[kind])
    def check(record: Any) -> None:
        assert same(codec.decode(kind, codec.encode(record)), record)

    check()


@settings(max_examples=examples(150), deadline=None)
@given(record=ANY_RECORD)
def test_rosbags_reads_and_writes_the_same_bytes(record: Any) -> None:
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    name = TOPIC_OF[type(record)].message
    data = codec.encode(record)
    assert bytes(store.serialize_cdr(store.deserialize_cdr(data, name), name)) == data


@settings(max_examples=examples(150), deadline=None)
@given(record=ANY_RECORD)
def test_rclpy_reads_and_writes_the_same_record(record: Any) -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    message = serialization.deserialize_message(
        codec.encode(record), codec.message_class(type(record))
    )
    data = serialization.serialize_message(message)
    assert same(codec.decode(type(record), data), record)


def test_scan_as_rclpy_sees_it() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    scan = r.Scan(1_283_500_000_123_456_789, ("motor_current", "load"), (1.5, math.nan))
    message = serialization.deserialize_message(codec.encode(scan), codec.message_class(r.Scan))
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_283_500_000, 123_456_789)
    assert list(message.name) == ["motor_current", "load"]
    assert message.position[0] == 1.5
    assert math.isnan(message.position[1])
    assert len(message.velocity) == len(message.effort) == 0


def test_message_built_by_rclpy_is_read() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    message = codec.message_class(r.Scan)()
    message.header.frame_id = "stand"
    message.header.stamp.sec = 7
    message.name = ["a", "b", "c"]
    message.position = [1.0, 2.0, 3.0]
    message.effort = [4.0, 5.0, 6.0]
    data = serialization.serialize_message(message)
    assert codec.decode(r.Scan, data) == r.Scan(7 * 10**9, ("a", "b", "c"), (1.0, 2.0, 3.0))


def test_vibration_as_rclpy_sees_it() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    samples = np.array([[1.0, -2.0], [math.nan, 4.5]], dtype=np.float32)
    block = r.VibrationBlock.pack(5, ("x", "y"), np.array([0, 50_000]), samples)
    cloud = serialization.deserialize_message(
        codec.encode(block), codec.message_class(r.VibrationBlock)
    )
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (1, 2, 12, 24)
    assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
        ("t", 0, cloud.fields[0].UINT32, 1),
        ("x", 4, cloud.fields[0].FLOAT32, 1),
        ("y", 8, cloud.fields[0].FLOAT32, 1),
    ]
    assert struct.unpack_from("<Iff", bytes(cloud.data)) == (0, 1.0, -2.0)
    offsets, decoded = codec.decode(r.VibrationBlock, codec.encode(block)).points()
    np.testing.assert_array_equal(offsets, [0, 50_000])
    np.testing.assert_array_equal(decoded, samples)


def verdict(**changes: Any) -> r.AmbiguityGroup:
    evidence = r.Evidence(5, "motor_current", "+", "+", "kept", "friction -> current")
    group = r.AmbiguityGroup(
        stamp_ns=10,
        outcome=r.Outcome.INDISTINGUISHABLE,
        episode=1,
        step=2,
        seq=3,
        members=(
            r.Candidate("jam", "friction+", 0.75, "fits", (evidence,), 120.0, 4.0, "N"),
            r.Candidate("ball_nut_friction", "friction+", 0.25, "fits"),
        ),
        dropped=(r.Candidate("winding_short", "winding_resistance-", 0.0, "current fell"),),
        detected_stamp_ns=8,
        words="jam or ball nut friction",
        calibration_sha256="ab",
        source="replay",
        not_observable=(("spall", "no accelerometer"),),
        to_do=(("run", "stop"), ("urgency", "now")),
    )
    return dataclasses.replace(group, **changes)


def test_verdict_can_be_read_in_any_viewer() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    data = codec.encode(verdict(), stand="flea")
    array = serialization.deserialize_message(data, codec.message_class(r.AmbiguityGroup))
    head, *rows = array.status
    assert head.message == "ERROR: jam or ball nut friction"
    assert head.level == b"\x02"
    assert head.hardware_id == "flea/actuator"
    assert [pair.key for pair in head.values][:6] == (
        ["outcome", "episode", "step", "seq", "members", "detected_stamp_ns"]
    )
    assert [pair.key for pair in head.values][6:8] == (["calibration_sha256", "source"])
    assert [pair.value for pair in head.values][:5] == (
        ["INDISTINGUISHABLE", "1", "2", "3", "jam, ball_nut_friction"]
    )
    assert [row.name for row in rows] == [
        "ambiguity_group/jam",
        "ambiguity_group/ball_nut_friction",
        "ambiguity_group/winding_short",
    ]
    assert [row.level for row in rows] == [b"\x02", b"\x02", b"\x00"]
    assert rows[0].message == "ERROR: possible, probability 0.75: fits"
    assert rows[2].message == "OK: dropped: current fell"
    assert {pair.key: pair.value for pair in rows[0].values}["size"] == "120.0"


def test_a_source_that_stopped_is_said_in_words() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    data = codec.encode(verdict(stale=True))
    array = serialization.deserialize_message(data, codec.message_class(r.AmbiguityGroup))
    assert array.status[0].level == b"\x03"
    assert array.status[0].message.startswith("STALE: the source has stopped")


def test_a_key_of_the_future_is_passed_over_and_a_new_field_takes_its_default() -> None:
    rows = [
        ("feature", "std"),
        ("episode", "1"),
        ("step", "2"),
        ("window_start_ns", "3"),
        ("window_end_ns", "4"),
        ("colour", "blue"),
    ]
    assert codec.decode(r.FeatureRequest, _array(rows)) == r.FeatureRequest(0, 1, 2, "std", 3, 4)
    with pytest.raises(
        WireError, match=r"FeatureRequest\.step: key 'step' is missing in the message"
    ):
        codec.decode(r.FeatureRequest, _array([row for row in rows if row[0] != "step"]))
    with pytest.raises(WireError, match=r"FeatureRequest\.step: 'two' is not a valid integer"):
        codec.decode(r.FeatureRequest, _array([(k, "two" if k == "step" else v) for k, v in rows]))


def _array(values: list[tuple[str, str]]) -> bytes:
    """One status with these key/values, made by rosbags."""
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    types = store.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "map")
    pairs = [types["diagnostic_msgs/msg/KeyValue"](key, value) for key, value in values]
    status = types["diagnostic_msgs/msg/DiagnosticStatus"](0, "n", "m", "h", pairs)
    message = types["diagnostic_msgs/msg/DiagnosticArray"](header, [status])
    return bytes(store.serialize_cdr(message, DIAGNOSTIC_ARRAY))


def test_a_level_of_a_bag_from_before_has_no_kurtosis_and_others_name_it_by_axis() -> None:
    before, now = (r.VibrationLevel(7, ("x", "y"), (0.1, 0.2), k) for k in ((), (3.0, 9.0)))
    assert codec.decode(r.VibrationLevel, codec.encode(r.Scan(7, ("x", "y"), (0.1, 0.2)))) == before
    seen = codec.decode(r.Scan, codec.encode(now))
    assert seen.channels == ("x", "y", "x/kurtosis", "y/kurtosis")
    assert seen.values == (0.1, 0.2, 3.0, 9.0)
    mixed = codec.encode(r.Scan(7, ("x/kurtosis", "x", "y"), (9.0, 0.1, 0.2)))
    with pytest.raises(WireError, match="names are not axes, all or none with the suffix"):
        codec.decode(r.VibrationLevel, mixed)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (r.Scan(2**31 * 10**9, (), ()), "does not fit a message"),
        (r.Scan(0, ("a",), ()), "1 names but 0 values"),
        (r.Scan(0, ("a\0b",), (1.0,)), "zero character"),
        (r.Scan(0, ("\ud800",), (1.0,)), "UTF-8"),
        (r.Residual(0, ("a/z",), (1.0,), (1.0,), (1.0,)), "contains a '/'"),
        (r.Residual(0, ("a",), (1.0,), (), (1.0,)), "0 z"),
        (r.Residual(0, (), (), (), (), ("v",), ()), "names but"),
        (r.Residual(0, (), (), (), (), (), (), ("v",), (1.0,)), "0 sigmas"),
        (r.Residual(0, (), (), (), (), health=(1.0,)), "health has 1"),
        (r.VibrationLevel(0, ("x", "y"), (1.0,), (3.0, 3.0, 3.0)), "2 axes but a kurtosis of 3"),
        (
            r.VibrationLevel(0, ("x/kurtosis",), (1.0,)),
            "axis 'x/kurtosis' has the reserved suffix '/kurtosis'",
        ),
        (r.VibrationBlock(0, ("x",), 2, bytes(8)), "2 points of 1 axes take 16"),
        (r.Health(0, "n", r.Level.OK, "m", (("k", "x" * (5 << 20)),)), "above the limit"),
        (r.FeatureRequest(0, 2**63, 0, "f", 0, 0), "does not fit 64 bits"),
    ],
)
def test_a_record_that_cannot_travel_is_refused(record: Any, words: str) -> None:
    with pytest.raises(WireError, match=words):
        codec.encode(record)


@settings(max_examples=examples(300), deadline=None)
@given(kind=st.sampled_from(list(RECORDS)), data=st.binary(max_size=200))
def test_arbitrary_bytes_are_read_or_refused_in_one_line(kind: type, data: bytes) -> None:
    read_or_refused(kind, data)
    read_or_refused(kind, b"\x00\x01\x00\x00" + data)


@settings(max_examples=examples(300), deadline=None)
@given(record=ANY_RECORD, data=st.data())
def test_damaged_messages_are_read_or_refused_in_one_line(record: Any, data: st.DataObject) -> None:
    whole = bytearray(codec.encode(record))
    for _ in range(data.draw(st.integers(0, 3))):
        place = data.draw(st.integers(0, len(whole) - 1))
        whole[place] = data.draw(st.integers(0, 255))
    read_or_refused(type(record), bytes(whole[: data.draw(st.integers(0, len(whole)))]))


@settings(max_examples=examples(100), deadline=None)
@given(record=ANY_RECORD, kind=st.sampled_from(list(RECORDS)))
def test_a_record_of_another_topic_is_read_or_refused_in_one_line(record: Any, kind: type) -> None:
    read_or_refused(kind, codec.encode(record))


def read_or_refused(kind: type, data: bytes) -> None:
    words = ""
    try:
        assert type(codec.decode(kind, memoryview(data))) is kind
    except WireError as error:
        words = str(error)
    assert "\n" not in words
    assert len(words) < 400


def test_a_name_that_changes_within_a_stream_is_seen() -> None:
    """The names of a stream are kept from message to message, and no more than its names."""
    first = r.Scan(0, ("motor_current", "load_force"), (1.0, 2.0))
    other = dataclasses.replace(first, channels=("motor_current", "load_forcf"))
    longer = r.Scan(0, ("motor_current", "load_force", "x"), (1.0, 2.0, 3.0))
    for record in (first, other, longer, first):
        assert codec.decode(r.Scan, codec.encode(record)) == record
    kept = len(cdr._KEPT)
    wide = r.Scan(0, ("c" * cdr.KEPT_BYTES,), (1.0,))
    assert codec.decode(r.Scan, codec.encode(wide)) == wide
    assert len(cdr._KEPT) == kept


def test_a_truncated_scan_is_never_read() -> None:
    data = codec.encode(r.Scan(1, ("a", "b"), (1.0, 2.0)))
    for size in range(len(data)):
        with pytest.raises(WireError):
            codec.decode(r.Scan, data[:size])


@pytest.mark.parametrize("size", [1_000_000, 2**32 - 1])
def test_an_announced_size_is_not_trusted(size: int) -> None:
    """A length of four thousand million strings in forty bytes allocates nothing."""
    head = b"\x00\x01\x00\x00" + bytes(8) + struct.pack("<IxxxxI", 1, size)
    with pytest.raises(WireError, match="announced"):
        codec.decode(r.Scan, head + bytes(20))


def test_oversized_bytes_are_refused_unread() -> None:
    with pytest.raises(WireError, match="above the limit of 1048576 bytes"):
        codec.decode(r.Scan, bytes((1 << 20) + 1))


def test_big_endian_is_named() -> None:
    with pytest.raises(WireError, match="not little-endian CDR"):
        codec.decode(r.Scan, b"\x00\x00\x00\x00" + bytes(24))
