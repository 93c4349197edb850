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

"""``flea simulate``, ``flea scenarios`` and ``flea realism`` as their users call them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.places import FLEA

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import ChannelTable, Scan, Truth, VibrationBlock
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.profile import commanded
from flea_sim_driver.scenario.scenario_file import overridden, scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

SCANS = [
    "\t".join(
        [f"2010-09-03_11:{k // 6000:02d}:{k // 100 % 60:02d}.{k % 100:02d}_-0700", *["1.0"] * 19]
    )
    for k in range(1000)
]
"""A run of the FLEA's own format in which nothing moves."""


def real_runs() -> Path:
    """Folder of the real recordings, or a skip."""
    if not FLEA.is_dir():
        pytest.skip("needs the public FLEA recordings: set FLEA_DATA_DIR to their folder")
    return FLEA


def test_a_simulated_bag_holds_what_the_stand_delivers(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    assert main(["simulate", "jam", "-o", str(bag), "--seed", "5", "--duration", "12"]) == 0
    stored = [record for _, record in read_bag(bag)]
    scenario = overridden(find_scenario("jam"), "test", {"seed": 5})
    start = stored[0].stamp_ns
    made = [r for r in SimulatedStand(scenario) if r.stamp_ns < start + 12 * 10**9]
    for kind in (ChannelTable, Truth, Scan, VibrationBlock):
        assert [r for r in stored if type(r) is kind] == [r for r in made if type(r) is kind]


def test_a_bag_of_another_machine_is_simulated_by_its_own_scenario(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    command = ["simulate", "nominal", "--machine", "wing", "-o", str(bag), "--duration", "0.5"]
    assert main([*command, "--seed", "3", "--unit-seed", "7"]) == 0
    stored = [record for _, record in read_bag(bag)]
    scans = [record for record in stored if isinstance(record, Scan)]
    assert len(scans) == 50
    assert "surface_angle" in scans[0].channels
    changed = overridden(find_scenario("nominal", "wing"), "test", {"seed": 3, "unit_seed": 7})
    made = SimulatedStand(changed).advance()
    assert scans[:10] == [record for record in made if isinstance(record, Scan)]


def test_the_list_is_that_of_the_machine(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "--list", "--machine", "ema"]) == 0
    shown = capsys.readouterr().out
    assert "scenarios of ema:\n  magnet_loss\n  nominal\n" in shown
    assert "weak_drive" in shown
    assert "load_motor_current_bias" not in shown
    assert main(["simulate", "--list"]) == 0
    shown = capsys.readouterr().out
    assert "weak_drive" not in shown
    assert all(f"  {name} " in shown for name in ("ema", "flea", "wing"))


def test_equal_commands_write_equal_files(tmp_path: Path) -> None:
    files = []
    for folder in ("a", "b"):
        bag = tmp_path / folder / "bag"
        bag.parent.mkdir()
        command = ["simulate", "nominal", "-o", str(bag), "--duration", "2"]
        assert main(command) == 0
        files.append((bag / "bag_0.mcap").read_bytes())
    assert files[0] == files[1]


def test_a_bag_can_be_flown_again(tmp_path: Path) -> None:
    bag = tmp_path / "flown"
    assert main(["simulate", "nominal", "-o", str(bag), "--duration", "8", "--no-vibration"]) == 0
    motion = {"kind": "flight", "file": "flown"}
    again = scenario_from_mapping({"motion": motion, "duration_s": 7.0}, "s.yaml", tmp_path)
    time = np.arange(0.5, 7.0, 0.01)
    position, load = commanded(again, time)
    expected, _ = commanded(find_scenario("nominal"), time)
    assert np.abs(np.gradient(position, 0.01)).max() < 0.1
    assert np.corrcoef(position, np.interp(time + 0.045, time, expected))[0, 1] > 0.99
    assert np.all(load == 0.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nominal"], "BAGDIR"),
        (["rust", "-o", "bag"], "'rust'"),
        (["nominal", "-o", "bag", "--fault", "rust"], "'rust'"),
        (["nominal", "-o", "bag", "--fault", "jam", "--at", "99"], "99.0 s"),
        (["nominal", "-o", "bag", "--fault", "jam", "--size", "99"], "99.0"),
        (["nominal", "-o", "bag", "--seed", "-2"], "-2"),
        (["nominal", "-o", "bag", "--duration", "nan"], "nan"),
        (["nominal", "-o", "bag", "--duration", "1e9"], "is above its limit 86400.0 s"),
        (["nominal", "-o", "bag", "--fault", "jam", "--at", "-1"], "-1.0 s is below its limit"),
        (["nominal", "-o", "bag", "--size", "2"], "--at and --size require --fault"),
    ],
)
def test_a_bad_command_is_one_line_and_leaves_nothing(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error
    assert list(tmp_path.iterdir()) == []


def test_the_catalogue_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "--list"]) == 0
    text = capsys.readouterr().out
    assert "unit_switch_jam" in text
    assert "load_position_dropout" in text
    assert "Controller capacitors, Thermal runaway (hybrid): capacitor_runaway, growth_s 8" in text


def test_the_papers_scenarios_are_written_as_files(tmp_path: Path) -> None:
    assert main(["scenarios", "table4", "--seed", "7", "-o", str(tmp_path / "t")]) == 0
    assert len(list((tmp_path / "t").glob("*.yaml"))) == 320
    (tmp_path / "file").write_text("")
    assert main(["scenarios", "table4", "-o", str(tmp_path / "file" / "t")]) == 2


@pytest.mark.parametrize(
    ("name", "lines", "words"),
    [
        ("sine34", ["hello"], "Line #1 (got 1 columns"),
        ("sine34", SCANS[:50], "50 scans, at least 1000 are compared"),
        ("sweep34", SCANS, "no motion 'sweep3' is known"),
        (
            "sine34",
            [line.replace("1.0", "NaN") for line in SCANS],
            "position or load is not measured throughout",
        ),
    ],
)
def test_realism_refuses_runs_that_it_cannot_compare(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, lines: list[str], words: str
) -> None:
    run = tmp_path / f"BatchProfile_{name}_x_Nominal_Low.data"
    run.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert main(["realism", str(run)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert words in said


def test_realism_refuses_foreign_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["realism", str(tmp_path / "x.data")]) == 2
    assert "none of 1 files" in capsys.readouterr().err
    broken = tmp_path / "BatchProfile_sine14_2010_09_03_09_04_53_Jam_Low.data"
    broken.write_text("a\tb\n1\t2\n")
    assert main(["realism", str(broken)]) == 2
    assert "BatchProfile_sine14" in capsys.readouterr().err


@pytest.mark.in_turn(2)
def test_the_stand_is_close_to_held_out_recordings(tmp_path: Path) -> None:
    folder = real_runs()
    wanted = ("sine16", "sine23", "triang34")
    files = [str(f) for f in sorted(folder.glob("*_Low.data")) if f.name.split("_")[1] in wanted]
    out = tmp_path / "realism.json"
    assert main(["realism", *files, "--json", str(out)]) == 0
    rows = json.loads(out.read_text())["runs"]
    limits = {"stroke": 0.15, "peak_speed": 0.25, "load_rms": 0.30,
              "current_rms": 0.25, "current_ripple": 0.25, "friction_force": 0.25,
              "voltage_rms": 0.30, "back_emf": 0.15, "resistance": 0.20, "pwm_line": 0.15,
              "position_noise": 0.30, "motor_temperature_noise": 0.40}  # fmt: skip
    for statistic, limit in limits.items():
        distances = [
            row["distance"]
            for row in rows
            if row["statistic"] == statistic and row["distance"] is not None
        ]
        assert len(distances) >= 5, statistic
        assert np.median(distances) < limit, (statistic, distances)


FULL = """
import resource, sys
from flea_diag.tools.main import main
main(["simulate", "jam", "-o", sys.argv[1] + "_compiled", "--duration", "1"])
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
sys.exit(main(["simulate", "jam", "-o", sys.argv[1], "--duration", "12"]))
"""
"""A disk on which no file grows beyond 100 kB."""


def test_a_full_disk_leaves_no_part_of_a_bag(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(bag)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert f"cannot write bag {bag}" in done.stderr
    assert "Traceback" not in done.stderr
    assert not bag.exists()


def test_a_folder_in_use_is_refused_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert main(["simulate", "jam", "-o", str(tmp_path), "--duration", "12"]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    "content",
    [
        "root:x:0:0:root:/root:/bin/bash\nsecret:x:1:1::/:/bin/sh\n",
        "secret\n",
        "[secret, secret]\n",
        "secret: {secret\n",
        "secret = *secret\n",
        "\tsecret: 1\n",
    ],
)
def test_a_file_that_is_no_scenario_is_not_quoted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    file = tmp_path / "passwd"
    file.write_text(content)
    assert main(["simulate", str(file), "-o", str(tmp_path / "bag")]) == 2
    said = capsys.readouterr().err
    assert str(file) in said
    assert said.count("\n") == 1
    assert "secret" not in said
    assert "/bin" not in said
