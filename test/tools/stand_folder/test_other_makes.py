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

"""Files of other makes: the right columns, or one line with the true cause."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from support.foreign.other_makes import CHANNELS, MAKES, write

from flea_diag.tools.main import main


@pytest.mark.parametrize("name", MAKES)
def test_a_file_of_another_make_ends_right_or_in_one_true_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    make = MAKES[name]
    file = write(tmp_path, name, make)
    status = main(["stand", "new", str(tmp_path / "mine"), "--from", str(file), *make.options])
    said = capsys.readouterr()
    if make.says:
        assert (status, said.err.count("\n")) == (2, 1)
        assert make.says in said.err
        return
    assert (status, said.err) == (0, "")
    text = (tmp_path / "mine" / "channels.yaml").read_text(encoding="utf-8")
    rows = yaml.safe_load(text)["channels"]
    joint = "".join(re.findall(r", joint (\w+)", said.out)[:1])
    found = tuple(rows[channel]["column"] for channel in CHANNELS)
    assert found == tuple(source.format(joint) for source in make.sources)
    assert set(rows) <= {*CHANNELS, "motor_temperature", "commanded_current", "load_force"}
