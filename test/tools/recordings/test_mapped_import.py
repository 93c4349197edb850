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

"""Recordings of other stands: topics and columns, units and signs, and what is refused."""

from __future__ import annotations

import copy
import gzip
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from support.decisions import BAGS
from support.foreign import arm

from flea_diag.tools import extra
from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import ChannelTable, Scan, Truth, VibrationBlock

BAG = BAGS / "winding_short"
START_NS = 1_500_000_000 * 10**9


@pytest.fixture(scope="module")
def sent() -> list[tuple[str, int, Any]]:
    return list(arm.messages(BAG))


def scans_of(bag: Path) -> tuple[tuple[str, ...], np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    found = [record for _, record in read_bag(bag, (Scan,)) if isinstance(record, Scan)]
    stamps = np.array([scan.stamp_ns for scan in found])
    return found[0].channels, stamps, np.array([scan.values for scan in found])


def decided(bag: Path, stand: str, tmp_path: Path) -> dict[str, Any]:
    path = tmp_path / f"{bag.name}.json"
    assert main(["replay", str(bag), "--stand", stand, "--json", str(path)]) == 0
    said = json.loads(path.read_text(encoding="utf-8"))
    keys = ("outcome", "detected_at_s", "isolated_at_s", "ambiguity_group", "scans")
    return {key: said[key] for key in keys}


def test_topics_of_any_type_give_the_decisions_of_our_own_bag(
    tmp_path: Path, sent: list[tuple[str, int, Any]]
) -> None:
    stand = arm.arm_stand(tmp_path / "arm")
    bag = arm.write_ros2(tmp_path / "session", iter(sent))
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    ours, found = scans_of(BAG), scans_of(tmp_path / "bags" / "session")
    assert (found[1] == ours[1]).all(), "the scans are those of the stamps"
    for column, name in enumerate(found[0]):
        expected = ours[2][:, ours[0].index(name)]
        tolerance = 2e-6 if name == "commanded_voltage" else 1e-12  # float32 in a BatteryState
        assert found[2][:, column] == pytest.approx(expected, rel=tolerance, abs=1e-9), name
    assert decided(tmp_path / "bags" / "session", "flea", tmp_path) == decided(
        BAG, "flea", tmp_path
    )


def test_the_channel_table_says_what_the_mapping_says(
    tmp_path: Path, sent: list[tuple[str, int, Any]]
) -> None:
    mapping = copy.deepcopy(arm.MAPPING)
    mapping["channels"]["motor_current"] |= {"serial": "A7", "mount": "elbow"}  # type: ignore[index]
    stand = arm.arm_stand(tmp_path / "arm", {**mapping, "truth": {"heal*": "nominal"}})
    bag = arm.write_ros2(tmp_path / "healthy_3", iter(sent[:600]))
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    records = [r for _, r in read_bag(tmp_path / "bags" / "healthy_3", (ChannelTable, Truth))]
    (table,) = [r for r in records if isinstance(r, ChannelTable)]
    row = table.info("motor_current")
    assert row is not None
    assert (row.unit, row.minimum, row.maximum, row.rate_hz) == ("A", -60.0, 60.0, 100.0)
    assert (row.serial, row.mount) == ("A7", "elbow")
    assert [r.fault for r in records if isinstance(r, Truth)] == ["nominal"]


# --- every type of message that stands send ------------------------------------------------------

DYNAMIC = "control_msgs/msg/DynamicJointState"
DEFINITION = """\
std_msgs/Header header
string[] joint_names
control_msgs/InterfaceValue[] interface_values
"""
INTERFACE = """\
string[] interface_names
float64[] values
"""
SENSORS: dict[str, tuple[str, str, str]] = {
    "motor_speed": ("sensor_msgs/msg/Imu", "angular_velocity.z", "deg/s"),
    "motor_voltage": ("sensor_msgs/msg/BatteryState", "voltage", "V"),
    "motor_temperature": ("std_msgs/msg/Float64MultiArray", "data[2]", "degF"),
    "motor_current": (DYNAMIC, "interface_values[elbow].values[effort]", "mA"),
}
"""Those that the arm does not send; the last is defined in the bag alone."""


def sensor_messages(count: int) -> Iterator[tuple[str, int, Any]]:
    """Readings that rise by one with each scan, in the units above."""
    t = arm.T
    nine, vector = np.zeros(9), t["geometry_msgs/msg/Vector3"]
    still, turn = vector(0.0, 0.0, 0.0), t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    layout, none = t["std_msgs/msg/MultiArrayLayout"]([], 0), np.zeros(0, dtype=np.float32)
    for k in range(count):
        stamp_ns = START_NS + k * 10_000_000
        header, at = arm.header_at(stamp_ns), float(k)
        imu = t["sensor_msgs/msg/Imu"](header, turn, nine, vector(0.0, 9.0, at), nine, still, nine)
        battery = t["sensor_msgs/msg/BatteryState"](
            header, at, *[0.0] * 6, 0, 0, 0, True, none, none, "", ""
        )
        interface = t["control_msgs/msg/InterfaceValue"]
        rows = [interface(["effort"], np.zeros(1)), interface(["v", "effort"], np.array([7.0, at]))]
        yield "/motor_speed", stamp_ns, imu
        yield "/motor_voltage", stamp_ns, battery
        yield (
            "/motor_temperature",
            stamp_ns,
            t["std_msgs/msg/Float64MultiArray"](layout, np.array([5.0, 6.0, at])),
        )
        yield "/motor_current", stamp_ns, t[DYNAMIC](header, ["shoulder", "elbow"], rows)


def test_imu_battery_array_and_dynamic_joint_states_are_read(tmp_path: Path) -> None:
    from rosbags.typesys import get_types_from_msg

    arm.STORE.register(get_types_from_msg(INTERFACE, "control_msgs/msg/InterfaceValue"))
    arm.STORE.register(get_types_from_msg(DEFINITION, DYNAMIC))
    channels = {
        name: {"topic": f"/{name}", "type": kind, "field": field, "unit": unit,
               "range": [-300.0, 300.0]}
        for name, (kind, field, unit) in SENSORS.items()
    }  # fmt: skip
    stand = arm.arm_stand(tmp_path / "arm", {**arm.MAPPING, "channels": channels})
    bag = arm.write_ros2(tmp_path / "session", sensor_messages(120))
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    names, _, values = scans_of(tmp_path / "bags" / "session")
    rising = np.arange(120.0)
    expected = {
        "motor_speed": np.radians(rising), "motor_voltage": rising,
        "motor_temperature": (rising - 32.0) / 1.8, "motor_current": 1e-3 * rising,
    }  # fmt: skip
    assert set(names) == set(expected)
    for name, wanted in expected.items():
        np.testing.assert_allclose(values[:, names.index(name)], wanted, rtol=1e-6, atol=1e-9)


# --- one line that says what is wrong, and nothing written --------------------------------------


def without(topic: str) -> Any:
    return lambda sent: (entry for entry in sent if entry[0] != topic)


def slower(sent: Iterator[Any]) -> Iterator[Any]:
    """The wrench comes at half the rate from 12 s on."""
    begin_ns = None
    for number, (topic, stamp_ns, message) in enumerate(sent):
        begin_ns = begin_ns or stamp_ns
        late = topic == arm.WRENCH and stamp_ns > begin_ns + 12 * 10**9
        if not (late and number // 6 % 2):
            yield topic, stamp_ns, message


ELBOW = {
    "motor_current": "effort",
    "motor_speed": "velocity",
    "actuator_position": "position",
}
REFUSED = {
    "a topic that is not there": (
        {}, without(arm.WRENCH), r"has no topic /arm/wrench, the source of load_force in ",
    ),
    "a type that is another": (
        {"motor_voltage": {"type": "std_msgs/msg/Float32"}}, iter,
        "/arm/voltage is of type std_msgs/msg/Float64, .* says std_msgs/msg/Float32",
    ),
    "a field that is not there": (
        {"load_force": {"field": "wrench.torc.z"}}, iter,
        "/arm/wrench: no field 'torc' in 'wrench.torc.z', it has force, torque",
    ),
    "a joint that is not there": (
        {k: {"field": f"{f}[wrist]"} for k, f in ELBOW.items()}, iter,
        r"/arm/joint_states has no element effort\[wrist\]: its elements are shoulder, elbow",
    ),
    "an array without an element": (
        {"motor_current": {"field": "effort"}}, iter, r"effort is an array: choose one element",
    ),
    "millimetres declared as metres": (
        {"actuator_position": {"unit": "m"}}, iter,
        "actuator_position reads .* outside its range .*: its unit is m, should it be mm",
    ),
    "a sum of wrong sign": (
        {"motor_current": {"range": [0.0, 60.0]}}, iter, "motor_current reads -.* A, .*%",
    ),
    "an unknown unit": (
        {"load_force": {"unit": "pounds"}}, iter, "load_force: unit: unit 'pounds' is unknown; use",
    ),
    "a unit of another quantity": (
        {"load_force": {"unit": "mm"}}, iter, "unit 'mm' cannot be converted to N; use N or kN",
    ),
    "no type": ({"motor_voltage": {"type": ""}}, iter, "topic /arm/voltage has no type; give"),
    "no source": (
        {"motor_voltage": {"topic": ""}}, iter, "names no source; give column, or topic",
    ),
    "a zero scale": ({"motor_voltage": {"scale": 0.0}}, iter, "scale = 0.0 must be above 0"),
    "a sign that is a factor": ({"load_force": {"sign": 2}}, iter, "sign = 2 must be 1 or -1"),
    "a range of one number": ({"load_force": {"range": [1.0]}}, iter, r"range = \[1.0\] must have"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_contradicts_the_mapping_is_refused_in_one_line(
    tmp_path: Path,
    sent: list[tuple[str, int, Any]],
    name: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    changes, altered, words = REFUSED[name]
    mapping = copy.deepcopy(arm.MAPPING)
    for channel, values in changes.items():
        mapping["channels"][channel] |= values  # type: ignore[index]
    stand = arm.arm_stand(tmp_path / "arm", mapping)
    bag = arm.write_ros2(tmp_path / "session", altered(iter(sent[:1800])))
    status = main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")])
    said = capsys.readouterr().err.splitlines()
    assert status != 0
    assert re.search(words, said[0]), said[0]
    assert not (tmp_path / "bags").exists()


def test_another_rate_is_said_and_taken_by_its_stamps(
    tmp_path: Path, sent: list[tuple[str, int, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    stand = arm.arm_stand(tmp_path / "arm")
    bag = arm.write_ros2(tmp_path / "session", slower(iter(sent)))
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    words = "load_force: readings come at 50 Hz from 1.* s on, declared are 100 Hz: taken by their"
    assert re.search(words, capsys.readouterr().err)
    names, _, values = scans_of(tmp_path / "bags" / "session")
    force = values[:-1, names.index("load_force")]
    assert np.isfinite(force[:1200]).all()
    assert 0.4 < np.isnan(force[1300:]).mean() < 0.6, "what was not read is not made up"


def test_lost_messages_are_no_other_rate(tmp_path: Path, sent: list[tuple[str, int, Any]]) -> None:
    stand = arm.arm_stand(tmp_path / "arm")
    lost = [entry for k, entry in enumerate(sent[:6000]) if entry[0] != arm.WRENCH or k % 60 != 33]
    assert len(lost) == 5900
    bag = arm.write_ros2(tmp_path / "lossy", iter(lost))
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    names, _, values = scans_of(tmp_path / "bags" / "lossy")
    assert np.isfinite(values[:, names.index("load_force")]).all(), "bridged between neighbours"


# --- tables --------------------------------------------------------------------------------------

TABLE: dict[str, object] = {
    "schema_version": 1,
    "rate_hz": 50.0,
    "split_by": ["load", "test"],
    "time": {"column": "t", "unit": "ms", "start": "2020-02-02T00:00:00Z"},
    "channels": {
        "motor_current": {"column": "i", "unit": "A", "range": [-10.0, 10.0]},
        "actuator_position": {
            "sum": [{"column": "set"}, {"column": "error", "sign": -1}],
            "unit": "mm",
            "range": [-0.1, 0.1],
        },
        "commanded_load": {"column": "load", "unit": "kgf", "sign": -1, "range": [-900.0, 900.0]},
    },
}
ROWS = [
    # t ms, set mm, error mm, i A, load kgf, test: two tests of 100 rows each
    (20.0 * k, 10.0 + 0.1 * k, 0.5, math.sin(0.1 * k), load, 1)
    for load in (20.0, -40.0)
    for k in range(100)
]
HEAD = ("t", "set", "error", "i", "load", "test")


def write_csv(path: Path, rows: list[tuple[float, ...]] = ROWS, mark: str = ",") -> Path:
    lines = [mark.join(HEAD), *(mark.join(map(repr, row)) for row in rows)]
    data = "\r\n".join(lines).encode()
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


def write_npz(path: Path) -> Path:
    np.savez_compressed(path, **dict(zip(HEAD, np.array(ROWS).T, strict=True)))
    return path


@pytest.mark.parametrize("name", ["runs.csv", "runs.csv.gz", "runs.npz"])
def test_a_table_is_split_into_its_tests(tmp_path: Path, name: str) -> None:
    stand = arm.arm_stand(tmp_path / "table", TABLE)
    file = write_npz(tmp_path / name) if name.endswith("npz") else write_csv(tmp_path / name)
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path / "bags")]) == 0
    assert sorted(p.name for p in (tmp_path / "bags").iterdir()) == ["runs_-40_1", "runs_20_1"]
    names, stamps, values = scans_of(tmp_path / "bags" / "runs_-40_1")
    assert names == ("motor_current", "actuator_position", "commanded_load")
    start_ns = 1_580_601_600 * 10**9
    assert stamps.tolist() == [start_ns + k * 20_000_000 for k in range(100)]
    assert values[:, 0].tolist() == [row[3] for row in ROWS[100:]]
    assert values[:, 1] == pytest.approx([1e-3 * (9.5 + 0.1 * k) for k in range(100)], rel=1e-12)
    assert set(values[:, 2]) == {40.0 * 9.80665}


def vibrating(accelerometers: dict[str, object], rows_hz: float = 1000.0) -> dict[str, object]:
    """A table sampled as fast as its accelerometers, with scans of 50 Hz."""
    return {
        "schema_version": 1,
        "rate_hz": 50.0,
        "time": {"column": "t", "unit": "s", "start": "2020-02-02T00:00:00Z"},
        "channels": {"motor_current": {"column": "i", "unit": "A", "range": [-10.0, 10.0]}},
        "accelerometers": {
            "accelerometer_2": {
                "axes": {"x": "ax", "z": "az"}, "unit": "g", "range": [-50.0, 50.0],
                "rate_hz": rows_hz, "mount": "nut", "serial": "S9", **accelerometers,
            }
        },
    }  # fmt: skip


def shaken(path: Path) -> Path:
    """2.5 s at 1 kHz: a current that rises, and a vibration in g that is known at each row."""
    rows = [(1e-3 * k, 1e-3 * k, 0.5 * math.sin(k), -1.0 + 1e-3 * k) for k in range(2500)]
    lines = ["t,i,ax,az", *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_accelerometers_of_a_table_become_vibration_with_rate_axes_and_mount(
    tmp_path: Path,
) -> None:
    stand = arm.arm_stand(tmp_path / "fast", vibrating({}))
    file = shaken(tmp_path / "run.csv")
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path / "bags")]) == 0
    _, stamps, values = scans_of(tmp_path / "bags" / "run")
    assert np.diff(stamps).tolist() == [20_000_000] * 124
    assert values[:, 0] == pytest.approx(0.02 * np.arange(125), abs=1e-9)
    kinds = (ChannelTable, VibrationBlock)
    records = [record for _, record in read_bag(tmp_path / "bags" / "run", kinds)]
    (table,) = [record for record in records if isinstance(record, ChannelTable)]
    row = table.info("accelerometer_2_z")
    assert row is not None
    assert (row.unit, row.rate_hz, row.mount, row.serial) == ("m/s^2", 1000.0, "nut", "S9")
    blocks = [record for record in records if isinstance(record, VibrationBlock)]
    assert {block.axes for block in blocks} == {("accelerometer_2_x", "accelerometer_2_z")}
    parts = [block.points() for block in blocks]
    times = np.concatenate(
        [b.stamp_ns + p[0].astype(np.int64) for b, p in zip(blocks, parts, strict=True)]
    )
    assert np.diff(times).tolist() == [1_000_000] * 2499
    k = np.arange(2500)
    expected = 9.80665 * np.column_stack([0.5 * np.sin(k), -1.0 + 1e-3 * k])
    np.testing.assert_allclose(np.concatenate([p[1] for p in parts]), expected, atol=1e-5)


@pytest.mark.parametrize(
    ("accelerometers", "rows_hz", "words"),
    [
        ({"unit": "V"}, 1000.0, "accelerometer_2: unit: unit 'V' cannot be converted to m/s"),
        ({"range": [-2.0, 2.0]}, 1000.0, "accelerometer_2_x reads .* m/s.2, .* outside its range"),
        (
            {"axes": {"x": "a9"}},
            1000.0,
            "no column 'a9', .*the column of accelerometer_2_x in",
        ),
        ({}, 2000.0, "motor_current: readings come at 1000 Hz from 0 s on, declared are 2000 Hz"),
    ],
)
def test_accelerometers_that_contradict_the_table_are_refused(
    tmp_path: Path,
    accelerometers: dict[str, object],
    rows_hz: float,
    words: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    stand = arm.arm_stand(tmp_path / "fast", vibrating(accelerometers, rows_hz))
    file = shaken(tmp_path / "run.csv")
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path / "bags")]) != 0
    said = capsys.readouterr().err.splitlines()[0]
    assert re.search(words, said), said
    assert not (tmp_path / "bags").exists()


def changed(place: int, column: int, value: float) -> list[tuple[float, ...]]:
    rows = [list(row) for row in ROWS]
    rows[place][column] = value
    return [tuple(row) for row in rows]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            [*ROWS, ROWS[0]],
            "runs_20_1 occurs twice: rows of one load, test must follow one another",
        ),
        (
            [(math.nan, *row[1:]) if k % 9 == 3 else row for k, row in enumerate(ROWS)],
            "11 of 100 rows have no t, the first is row 4; every row needs a time",
        ),
        (changed(3, 0, 1e18), "t = 1e+18 is no time before 2128; give its unit under time"),
        ([], "its columns have [0] rows"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(
    tmp_path: Path,
    rows: list[tuple[float, ...]],
    words: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    stand = arm.arm_stand(tmp_path / "table", TABLE)
    file = write_csv(tmp_path / "runs.csv", rows)
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path / "bags")]) == 1
    assert words in capsys.readouterr().err.splitlines()[0]
    assert not (tmp_path / "bags").exists()


DAMAGED = {
    "a cell that is no number": (
        b"t,set,error,i,load,test\n0,x,0,0,0,1\n",
        "line 2: 'set' = 'x' is",
    ),
    "a line that is cut off": (
        b"t,set,error,i,load,test\n0,1,0\n",
        "line 2 has 3 columns instead of 6, and so do 1 of 1 rows; the file is cut off",
    ),
    "a column that is missing": (
        b"t;set;error\n0;1;2\n",
        "has no column 'i', it has t, set, error; correct the column of motor_current in",
    ),
    "a column twice": (b"t,t,set,error,i,load,test\n", "has 2 columns 't'"),
    "a line without end": (b"t" * 200_000, "line 1 has more than 100000 characters"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_table_is_refused(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    data, words = DAMAGED[name]
    stand, file = arm.arm_stand(tmp_path / "table", TABLE), tmp_path / "runs.csv"
    file.write_bytes(data)
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path / "bags")]) == 1
    assert words in capsys.readouterr().err.splitlines()[0]


def test_no_array_of_python_objects_is_loaded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stand = arm.arm_stand(tmp_path / "table", TABLE)
    columns = dict(zip(HEAD, np.array(ROWS).T, strict=True))
    columns["i"] = np.array([object()] * len(ROWS))
    np.savez(tmp_path / "runs.npz", allow_pickle=True, **columns)
    file = str(tmp_path / "runs.npz")
    assert main(["import", "--stand", str(stand), file, "-o", str(tmp_path / "bags")]) == 1
    assert "'i' is of type object in 1 dimensions" in capsys.readouterr().err


def test_an_array_that_announces_more_than_it_holds_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import zipfile

    stand, file = arm.arm_stand(tmp_path / "table", TABLE), tmp_path / "runs.npz"
    write_npz(tmp_path / "sound.npz")
    with zipfile.ZipFile(tmp_path / "sound.npz") as sound, zipfile.ZipFile(file, "w") as bomb:
        for name in sound.namelist():
            bomb.writestr(name, sound.read(name).replace(b"(200,)", b"(9**,)"))
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path / "bags")]) == 1
    assert "cannot be read" in capsys.readouterr().err


def test_parquet_says_which_package_it_needs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extra, "find_spec", lambda name: None)
    stand, file = arm.arm_stand(tmp_path / "table", TABLE), tmp_path / "runs.parquet"
    file.write_bytes(b"PAR1")
    assert main(["import", "--stand", str(stand), str(file), "-o", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "needs pyarrow, not installed: " in said
    assert "-m pip install 'pyarrow>=15'" in said


@pytest.mark.parametrize("packed", [False, True])
def test_a_bag_of_ros_1(tmp_path: Path, packed: bool) -> None:
    mapping = {
        "schema_version": 1,
        "rate_hz": 20.0,
        "channels": {
            "motor_current": {
                "topic": "i", "type": "std_msgs/Float64", "field": "data", "unit": "mA",
                "range": [-10.0, 10.0],
            },
            "motor_temperature": {
                "topic": "t", "type": arm.TEMPERATURE, "field": "temperature", "unit": "degC",
                "range": [0.0, 200.0], "rate_hz": 2.0, "resample": "hold",
            },
        },
    }  # fmt: skip
    from rosbags.typesys import Stores, get_typestore

    kinds = get_typestore(Stores.ROS1_NOETIC).types

    def sent() -> Iterator[tuple[str, int, Any]]:
        for k in range(100):
            stamp_ns = START_NS + k * 50_000_000
            if k % 10 == 0:
                time = kinds["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
                header = kinds["std_msgs/msg/Header"](0, time, "")
                yield "/t", stamp_ns, kinds[arm.TEMPERATURE](header, 20.0 + k, 0.0)
            yield "/i", stamp_ns, kinds["std_msgs/msg/Float64"](10.0 * k)

    stand = arm.arm_stand(tmp_path / "old", mapping)
    bag = arm.write_ros1(tmp_path / "old.bag", sent(), packed)
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    names, stamps, values = scans_of(tmp_path / "bags" / "old")
    assert names == ("motor_current", "motor_temperature")
    assert stamps.tolist() == [START_NS + k * 50_000_000 for k in range(100)]
    assert values[:, 0] == pytest.approx([0.01 * k for k in range(100)], rel=1e-12)
    assert values[:, 1].tolist() == [20.0 + k // 10 * 10 for k in range(100)]


def test_the_fleas_own_format_is_that_of_its_stand(tmp_path: Path) -> None:
    from flea_diag.configuration.channels import channel_sources
    from flea_diag.configuration.stand import load_stand

    assert channel_sources(load_stand("flea")).format == "flea_text"
    mine = arm.arm_stand(tmp_path / "mine")
    content = yaml.safe_load((mine / "stand.yaml").read_text(encoding="utf-8"))
    del content["channels"]
    (mine / "stand.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    assert main(["import", "--stand", str(mine), "x.csv", "-o", str(tmp_path)]) == 2
