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

"""FLEA recordings to bags: units, signs, truth and bad input, on made and on real files."""

from __future__ import annotations

import calendar
import json
import math
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import examples
from support.places import FLEA

from flea_diag.errors import RecordingError
from flea_diag.tools.main import main
from flea_diag.tools.recordings import flea_data
from flea_diag.tools.recordings.flea_run import (
    CHANNELS,
    FleaRun,
    Label,
    active_motor,
    find_run_away,
    label_of,
)
from flea_diag.tools.replay.size_estimates import serial_of
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import read_bag

NAME = "BatchProfile_sine12_2010_09_03_09_52_47_Nominal_Low.data"
EPOCH_S = calendar.timegm((2010, 9, 3, 16, 52, 47))


def line(number: int, **changes: str) -> str:
    """One line of a file in which motor X runs (its current is a square wave)."""
    values = dict.fromkeys(flea_data.COLUMNS, "NaN")
    values |= {
        "Actuator Z Position": "40.000000",
        "Measured Load": "10.000000",
        "Motor X Current": "2.000000" if number % 2 else "-2.000000",
        "Motor Y Current": "0.320000",
        "Motor Z Current": "-0.500000",
        "Motor X Voltage": "-12.000000",
        "Motor Y Voltage": "0.250000",
        "Motor X Temperature": "30.000000",
        "Motor Y Temperature": "31.000000",
        "Nut X Temperature": "32.000000",
        "Nut Y Temperature": "33.000000",
        "Ambient Temperature": "22.500000",
    }
    values |= {key.replace("_", " "): value for key, value in changes.items() if key != "stamp"}
    stamp = changes.get(
        "stamp", f"2010-09-03_09:52:{47 + number // 100}.{number % 100:02d}000_-0700"
    )
    return "\t".join([stamp, *values.values()]) + "\n"


def write(folder: Path, lines: list[str], name: str = NAME) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_text("".join(lines))
    return file


def scans_of(bag: Path) -> list[r.Scan]:
    return [record for _, record in read_bag(bag, [r.Scan]) if isinstance(record, r.Scan)]


def test_units_signs_and_stamps(tmp_path: Path) -> None:
    file = write(tmp_path, [line(number) for number in range(100)])
    assert main(["import", str(file), "-o", str(tmp_path / "bags")]) == 0
    scans = scans_of(tmp_path / "bags" / NAME.removesuffix(".data"))
    assert len(scans) == 100
    assert scans[0].stamp_ns == EPOCH_S * 10**9
    assert scans[7].stamp_ns == EPOCH_S * 10**9 + 70_000_000
    first = dict(zip(scans[0].channels, scans[0].values, strict=True))
    assert math.isnan(first.pop("load_position"))
    assert first == {
        "motor_current": 2.0,
        "motor_voltage": 12.0,
        "actuator_position": 0.04,
        "load_force": pytest.approx(44.482216152605, rel=1e-12),
        "motor_temperature": 30.0,
        "nut_temperature": 32.0,
        "ambient_temperature": 22.5,
        "load_motor_current": 0.5,
    }


def test_the_motor_that_runs_is_seen_in_its_current_not_in_the_label(tmp_path: Path) -> None:
    swapped = {"Motor_Y_Current": "1.000000", "Motor_X_Current": "0.300000"}
    lines = [
        line(n, **(swapped if n % 2 else {**swapped, "Motor_Y_Current": "-1.000000"}))
        for n in range(50)
    ]
    assert active_motor(flea_data.read_flea_data(write(tmp_path, lines))) == "Y"
    idle = [line(n, Motor_X_Current="0.320000") for n in range(50)]
    with pytest.raises(RecordingError, match="cannot tell which test motor runs"):
        active_motor(flea_data.read_flea_data(write(tmp_path, idle)))


def test_nothing_that_a_stage_sees_betrays_the_unit_or_the_label(tmp_path: Path) -> None:
    names = [NAME, NAME.replace("Nominal", "Jam")]
    swapped = {"Motor_Y_Current": "2.000000", "Motor_X_Current": "0.320000"}
    swapped |= {"Motor_Y_Voltage": "-12.000000", "Motor_Y_Temperature": "30.000000"}
    swapped |= {"Nut_Y_Temperature": "32.000000"}
    other = [
        line(n, **(swapped if n % 2 else {**swapped, "Motor_Y_Current": "-2.000000"}))
        for n in range(100)
    ]
    files = [
        write(tmp_path, [line(n) for n in range(100)], names[0]),
        write(tmp_path, other, names[1]),
    ]
    assert main(["import", *map(str, files), "-o", str(tmp_path / "bags")]) == 0
    seen = [
        list(read_bag(tmp_path / "bags" / name.removesuffix(".data"), [r.ChannelTable, r.Scan]))
        for name in names
    ]
    assert repr(seen[0]) == repr(seen[1])
    truths = [
        [t for _, t in read_bag(tmp_path / "bags" / n.removesuffix(".data"), [r.Truth])]
        for n in names
    ]
    assert [(t.fault, t.onset_ns) for (t,) in truths] == [  # type: ignore[union-attr]
        ("nominal", r.NEVER_NS),
        ("jam", EPOCH_S * 10**9),
    ]


def test_duplicate_and_backward_stamps_are_kept_in_the_order_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = [line(n) for n in (0, 1, 1, 2, 5, 3, 6)]
    file = write(tmp_path, lines)
    assert main(["import", str(file), "-o", str(tmp_path / "bags"), "--json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    assert (report["duplicate_stamps"], report["backward_stamps"]) == (1, 1)
    scans = scans_of(tmp_path / "bags" / NAME.removesuffix(".data"))
    assert [(s.stamp_ns - EPOCH_S * 10**9) // 10**7 for s in scans] == [0, 1, 1, 2, 5, 3, 6]


BAD_LINES = [
    (line(50)[:60] + "\n", r"columns, must be 20"),
    (line(50, Motor_X_Current="two"), r"column 8 \(Motor X Current\) = 'two' is not a number"),
    (line(50, Measured_Load="5000.0"), r"'5000.0' is outside its limits of -1000 to 1000 lb"),
    (line(50, Motor_X_Voltage="inf"), r"'inf' is outside its limits of -60 to 60 V"),
    (line(50, stamp="2010-13-03_09:52:47.0_-0700"), r"is not a date and time"),
    (line(50, stamp="9010-09-03_09:52:47.0_-0700"), r"outside its limits of the years 1980"),
    (line(50, stamp="2010-09-03_09:52:61.0_-0700"), r"outside its limits of the years 1980"),
    (line(50, stamp="yesterday"), r"column 1 \(Time\) = 'yesterday' must be like"),
    ("x" * 2000 + "\n", r"longer than the limit of 1024 bytes"),
]


@pytest.mark.parametrize(("bad", "words"), BAD_LINES)
def test_a_bad_line_is_named_and_the_others_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bad: str, words: str
) -> None:
    lines = [line(number) for number in range(100)]
    lines[50] = bad
    file = write(tmp_path, lines)
    assert main(["import", str(file), "-o", str(tmp_path / "bags")]) == 1
    first = capsys.readouterr().err.splitlines()[0]
    assert first.startswith(f"flea: {NAME}: line 51: ")
    with pytest.raises(AssertionError, match=words):
        raise AssertionError(first)
    assert len(scans_of(tmp_path / "bags" / NAME.removesuffix(".data"))) == 99


@pytest.mark.parametrize(("cut", "kept"), [(1, 100), (2, 99), (40, 99)])
def test_a_file_that_ends_within_its_last_line(tmp_path: Path, cut: int, kept: int) -> None:
    """Without its newline alone the last line is whole; a number that lost a digit is not."""
    content = "".join(line(number) for number in range(100))
    data = flea_data.read_flea_data(write(tmp_path, [content[:-cut]]))
    assert len(data.stamps_ns) == kept
    assert len(data.dropped) == 100 - kept
    assert all("line 100: the file ends within it" in words for words in data.dropped)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (b"hello\nworld\n", r"line 1: 1 columns, must be 20 \(2 of 2 lines"),
        (bytes(range(256)) * 40, "not a FLEA .data file"),
    ],
)
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    file = tmp_path / NAME
    file.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        flea_data.read_flea_data(file)


def test_a_huge_or_missing_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / NAME
    with file.open("wb") as stream:
        stream.truncate(flea_data.FILE_LIMIT_BYTES + 1)
    with pytest.raises(RecordingError, match="above the limit of 33554432 bytes"):
        flea_data.read_flea_data(file)
    with pytest.raises(RecordingError, match="cannot read"):
        flea_data.read_flea_data(tmp_path / "missing.data")


def test_a_batch_goes_on_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = write(tmp_path, [line(number) for number in range(50)])
    bad = tmp_path / "notes.data"
    bad.write_text("shopping list\n")
    command = ["import", str(bad), str(good), "-o", str(tmp_path / "bags")]
    assert main(command) == 1
    told = capsys.readouterr()
    assert told.err.splitlines()[-1] == (
        "flea: 1 of 2 files imported, 1 refused, 0 with lines dropped"
    )
    (bag,) = (tmp_path / "bags").rglob("*.mcap")
    assert len(scans_of(bag.parent)) == 50
    alone = bag.read_bytes()
    assert main([*command, "--force", "-j", "2"]) == 1
    assert capsys.readouterr() == told
    assert bag.read_bytes() == alone


def test_a_bag_is_replaced_only_by_force_and_only_a_bag(tmp_path: Path) -> None:
    file = write(tmp_path, [line(number) for number in range(50)])
    command = ["import", str(file), "-o", str(tmp_path / "bags")]
    assert main(command) == 0
    assert main(command) == 1
    assert main([*command, "--force"]) == 0
    bag = tmp_path / "bags" / NAME.removesuffix(".data")
    (bag / "thesis.tex").write_text("mine")
    assert main([*command, "--force"]) == 1
    assert (bag / "thesis.tex").exists()


def test_two_imports_are_equal_byte_for_byte(tmp_path: Path) -> None:
    file = write(tmp_path, [line(number) for number in range(50)])
    for name in ("a", "b"):
        assert main(["import", str(file), "-o", str(tmp_path / name)]) == 0
    bags = [next((tmp_path / name).rglob("*.mcap")).read_bytes() for name in ("a", "b")]
    assert bags[0] == bags[1]


def test_a_serial_number_that_is_given_is_that_of_the_test_actuator(tmp_path: Path) -> None:
    file = write(tmp_path, [line(number) for number in range(50)])
    assert main(["import", str(file), "-o", str(tmp_path / "a"), "--serial", "X-1"]) == 0
    assert main(["import", str(file), "-o", str(tmp_path / "b")]) == 0
    (one,), (other,) = (
        [t for _, t in read_bag(tmp_path / name / NAME.removesuffix(".data"), [r.ChannelTable])]
        for name in "ab"
    )
    assert serial_of(one) == "X-1"  # type: ignore[arg-type]
    assert serial_of(other) == ""  # type: ignore[arg-type]
    numbers = {row.name: row.serial for row in one.channels}  # type: ignore[union-attr]
    assert numbers["nut_temperature"] == "X-1"
    assert numbers["load_force"] == numbers["ambient_temperature"] == ""


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("BatchProfile_sine12_2010_09_03_09_52_47_Nominal_Low", Label("nominal")),
        ("BatchProfile_trap14_2010_09_03_09_11_17_Jam_Low", Label("jam")),
        ("B_trap14_2010_09_03_16_57_39_Spall_Low", Label("spall")),
        (
            "B_x_Position_t+20.88_o+0.00_s+0.00_Low",
            Label("actuator_position_dead", 20.88, 0.0, 0.0),
        ),
        ("B_x_Position_t+2.5_o-5.00_s+1.00_Low", Label("actuator_position_bias", 2.5, -5.0, 1.0)),
        ("B_x_Position_t+2.5_o+0.00_s+1.20_Low", Label("actuator_position_scaling", 2.5, 0.0, 1.2)),
        ("B_x_Position_Low", None),
        ("B_x_Position_t+1.2.3_o+0_s+0_Low", None),
        ("holiday", None),
    ],
)
def test_what_a_name_tells(name: str, label: Label | None) -> None:
    found = label_of(name)
    assert repr(found) == repr(label)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_run_away_begins_where_the_speed_begins_to_grow(direction: int) -> None:
    """Slow sine, then from sample 1500 on 110 mm/s reached within 0.1 s."""
    time_s = np.arange(3000) / 100
    position = 50 + 10 * np.sin(2 * np.pi * 0.5 * time_s)
    after = np.clip(time_s - 15.0, 0, None)
    travelled = np.where(after < 0.1, 550 * after**2, 5.5 + 110 * (after - 0.1))
    position = np.where(after > 0, position[1500] + travelled, position)
    position = np.clip(position, 0, 100)
    found = find_run_away(position if direction > 0 else 100 - position)
    assert found is not None
    assert abs(found - 1500) <= 4


def test_no_run_away_without_an_end_stop() -> None:
    assert find_run_away(50 + 10 * np.sin(np.arange(1000) / 50)) is None


@settings(
    max_examples=examples(100),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray("".join(line(number) for number in range(40)).encode())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file = tmp_path / NAME
    file.write_bytes(content)
    words = ""
    try:
        read = flea_data.read_flea_data(file)
        assert read.values.shape == (len(read.stamps_ns), 19)
        words = "".join(read.dropped)
    except RecordingError as error:
        words = str(error)
    assert "\n" not in words


# --- the real recordings ----------------------------------------------------------------


@pytest.fixture(scope="module")
def flea_files() -> Path:
    if not FLEA.is_dir():
        pytest.skip("no FLEA recordings: set FLEA_DATA_DIR to the folder that holds flea/")
    return FLEA


def table_of(run: FleaRun) -> dict[str, npt.NDArray[np.float64]]:
    rows = np.array([scan.values for scan in run.scans()])
    return {name: rows[:, k] for k, name in enumerate(CHANNELS)}


def smooth(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.convolve(values, np.ones(21) / 21, mode="valid")


RUNS = [
    ("sine12_2010_09_03_09_52_47_Nominal", "Y", 2970),
    ("triang12_2010_09_03_12_19_46_Nominal", "Y", 2990),
    ("sine14_2010_09_03_16_51_40_Spall", "X", 2980),
    ("triang34_2010_09_03_16_19_19_Jam", "X", 2960),
]


@pytest.mark.parametrize(("name", "motor", "count"), RUNS)
def test_signs_of_real_runs(flea_files: Path, name: str, motor: str, count: int) -> None:
    """In our signs V = R i + K v and i = F / K + friction, with all three positive.

    The figures are those published with the recordings: R 2.7 to 3.6 ohm, K about 176 V s/m.
    """
    run = FleaRun.of(flea_data.read_flea_data(flea_files / f"BatchProfile_{name}_Low.data"))
    assert run.unit == motor
    channels = table_of(run)
    assert len(channels["motor_current"]) == count
    speed = np.gradient(smooth(channels["actuator_position"])) * 100
    current, voltage = smooth(channels["motor_current"]), smooth(channels["motor_voltage"])
    electrical = np.column_stack([current, speed, np.ones_like(speed)])
    (resistance, constant, _), *_ = np.linalg.lstsq(electrical, voltage, rcond=None)
    assert 2.4 < resistance < 4.0
    assert 150 < constant < 200
    force = smooth(channels["load_force"])
    mechanical = np.column_stack([force, np.sign(speed), speed, np.ones_like(speed)])
    (per_newton, friction, *_), *_ = np.linalg.lstsq(mechanical, current, rcond=None)
    assert 0.0045 < per_newton < 0.011
    assert friction > 0
    assert np.corrcoef(force, smooth(channels["load_motor_current"]))[0, 1] < 0


def test_a_real_position_run(flea_files: Path) -> None:
    (file,) = flea_files.glob("*trap14*Position*")
    run = FleaRun.of(flea_data.read_flea_data(file))
    truth = run.truth()
    assert truth is not None
    assert truth.fault == "actuator_position_dead"
    # The name says 21.67 s, and is right to 1 s.
    assert run.onset is not None
    assert abs(run.onset / 100 - 21.67) < 1
    assert truth.onset_ns == run.data.stamps_ns[run.onset]
    assert dict(truth.details)["name_time_s"] == "21.67"
    reading = table_of(run)["actuator_position"]
    raw = 1e-3 * run.data.column("Actuator Z Position")
    np.testing.assert_array_equal(reading[: run.onset], raw[: run.onset])
    dead = reading[run.onset :]
    assert abs(dead.mean()) < 1e-5
    assert 5e-5 < dead.std() < 7e-5
    assert len(np.unique(np.round(dead / 3.6e-6, 6) % 1)) == 1
    assert raw[-1] == pytest.approx(0.1)


def test_all_real_runs_import_in_time(
    flea_files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = sorted(map(str, flea_files.glob("*.data")))[::9]
    begin = time.process_time()
    assert main(["import", *files, "-o", str(tmp_path), "--json"]) == 0
    assert (time.process_time() - begin) / len(files) < 1.0
    reports = json.loads(capsys.readouterr().out)
    assert [report["dropped_lines"] for report in reports] == [0] * len(files)
    for report in reports:
        healthy = report["fault"] in ("nominal", "actuator_position_dead")
        assert report["test_actuator"] == ("Y" if healthy else "X")
