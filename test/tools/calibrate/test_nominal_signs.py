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

"""``flea calibrate`` refuses a sign that the balance of power contradicts, before it fits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.decisions import BAGS

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import BagWriter, read_bag
from flea_diag.wire.records import ChannelTable, Scan


def turned(bag: Path, channel: str, source: str) -> str:
    """A shipped bag with one channel of the other sign."""
    with BagWriter(bag, whole_every_s=None) as writer:
        for log_ns, record in read_bag(BAGS / source, (ChannelTable, Scan)):
            if isinstance(record, Scan):
                column = record.channels.index(channel)
                values = list(record.values)
                values[column] *= -1.0
                record = replace(record, values=tuple(values))
            writer.write(record, log_ns)
    return str(bag)


def test_a_turned_sign_is_one_line_and_no_calibration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bags = [turned(tmp_path / name, "motor_current", name) for name in ("nominal", "winding_short")]
    capsys.readouterr()
    assert main(["calibrate", bags[0], bags[0] + "/", "-o", str(tmp_path / "cal.yaml")]) == 2
    words = capsys.readouterr().err.splitlines()[-1]
    assert "motor_current: " in words
    assert words.endswith("correct its sign where they are imported, and import them again")
    assert not (tmp_path / "cal.yaml").exists()
