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

"""Units of channels against SI: what is another unit is refused by name, never converted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support import stands
from support.decisions import BAGS, NAMES

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.residuals.channel_units import UNITS, unit_refusal
from flea_diag.tools.bags.findings import check
from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import BagWriter, read_bag
from flea_diag.wire.records import ChannelInfo, ChannelTable, Outcome, Scan

FLEA = compiled_relations("actuator.yaml").residuals

NEEDED = "convert it at the source"
WRONG = [
    ("motor_current", "mA", "A"),
    ("motor_current", "furlong", "A"),
    ("motor_voltage", "mV", "V"),
    ("commanded_voltage", "%", "V"),
    ("motor_speed", "rpm", "rad/s"),
    ("motor_speed", "deg/s", "rad/s"),
    ("actuator_position", "mm", "m"),
    ("load_position", "inch", "m"),
    ("load_force", "kN", "N"),
    ("load_force", "lbf", "N"),
    ("motor_temperature", "K", "degC"),
    ("nut_temperature", "degF", "degC"),
    ("ambient_temperature", "a", "degC"),
    ("accelerometer_1_x", "g", "m/s^2"),
]


def table(channel: str, unit: str) -> ChannelTable:
    """The stand's table with another unit of one channel."""
    made = stands.table(extra=("accelerometer_1_x",))
    rows = (replace(row, unit=unit) if row.name == channel else row for row in made.channels)
    return replace(made, channels=tuple(rows))


def test_every_channel_has_a_unit() -> None:
    assert set(UNITS) == set(FLEA.channels)


@pytest.mark.parametrize(("channel", "unit", "needed"), WRONG)
def test_a_wrong_unit_is_refused_by_channel_and_both_units(
    channel: str, unit: str, needed: str
) -> None:
    said = f"{channel} is in {unit!r}, must be in {needed!r}: {NEEDED}"
    assert unit_refusal(channel, unit) == said


@pytest.mark.parametrize(
    ("channel", "unit"),
    [
        *UNITS.items(),
        ("motor_temperature", "C"),
        ("motor_temperature", "\N{DEGREE SIGN}C"),
        ("accelerometer_2_z", "m/s\N{SUPERSCRIPT TWO}"),
        ("motor_current", ""),
        ("cabin_pressure", "furlong"),
    ],
)
def test_si_an_unknown_unit_and_a_foreign_channel_are_taken(channel: str, unit: str) -> None:
    assert unit_refusal(channel, unit) == ""


def _in_milliamperes(row: ChannelInfo) -> ChannelInfo:
    return replace(row, unit="mA") if row.name == "motor_current" else row


def test_the_verdict_is_a_mismatch_that_names_it() -> None:
    records = [record for _, record in read_bag(BAGS / "nominal", (ChannelTable, Scan))][:300]
    wrong = [
        replace(record, channels=tuple(_in_milliamperes(row) for row in record.channels))
        if isinstance(record, ChannelTable)
        else record
        for record in records
    ]
    said = stands.verdict(stands.replay(make_pipeline(load_stand()), wrong))
    assert said.outcome is Outcome.MODEL_MISMATCH
    assert said.words == f"motor_current is in 'mA', must be in 'A': {NEEDED}"


def test_bag_check_says_it_as_an_error(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", whole_every_s=None) as bag:
        bag.write(table("motor_current", "mA"))
    words = f"/sensors/channels: motor_current is in 'mA', must be in 'A': {NEEDED} (1 messages)"
    assert words in [finding.words for finding in check(tmp_path / "bag") if finding.error]


@pytest.mark.parametrize("bag", NAMES)
def test_every_bag_that_is_shipped_is_in_si(bag: str) -> None:
    tables = [record for _, record in read_bag(BAGS / bag, (ChannelTable,))]
    assert tables
    for found in tables:
        assert isinstance(found, ChannelTable)
        assert not [words for row in found.channels if (words := unit_refusal(row.name, row.unit))]


def test_bag_check_takes_the_units_of_a_stand_from_its_description(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = stands.table(extra=("surface_angle",))
    rows = (replace(r, unit="deg") if r.name == "surface_angle" else r for r in made.channels)
    with BagWriter(tmp_path / "wing") as bag:
        bag.write(replace(made, channels=tuple(rows)), made.stamp_ns)
    said = "surface_angle is in 'deg', must be in 'rad'"
    for stand, told in (((), False), (("--stand", "wing"), True)):
        main(["bag", "check", str(tmp_path / "wing"), *stand])
        assert (said in capsys.readouterr().out) == told
