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

"""The generator of well-formed bombs: ten rows for each gate, and a judge that sees faults."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter

from support.bombs.table import BOMBS
from support.places import ROOT

GATES = ("file", "bag", "YAML", "JSON", "message", "text", "total", "page")
PLANTED = """
import json, sys
sys.path[:0] = ["bench/robustness", "test", "."]
from bombs import judge
from support.bombs.bomb import REFUSED, TOLD, Input, rows

def fails(folder, chance): return Input(lambda: 1 / 0, TOLD)
def silent(folder, chance): return Input(lambda: 0, TOLD)
def large(folder, chance): return Input(lambda: print(len(b"x" * 700_000_000)) or 0, TOLD)
def raw(folder, chance): return Input(lambda: print(chr(27)) or 0, TOLD)
def read(folder, chance): return Input(lambda: print("read") or 0, REFUSED)
def no(): return print("flea: no", file=sys.stderr) or 2
def unnamed(folder, chance): return Input(no, TOLD, ("motor",))
def sound(folder, chance): return Input(no, REFUSED, ("no",))

made = rows("g", fails, silent, large, raw, read, unnamed, sound, prepare=lambda: None)
print(json.dumps({bomb.name: judge(bomb, 1).faults for bomb in made}))
"""


def test_each_gate_has_ten_rows_of_names_of_their_own() -> None:
    counts = Counter(bomb.gate for bomb in BOMBS)
    assert set(counts) == set(GATES)
    assert min(counts.values()) >= 10
    assert len({(bomb.gate, bomb.name) for bomb in BOMBS}) == len(BOMBS)


def test_the_judge_sees_what_is_planted() -> None:
    command = [sys.executable, "-c", PLANTED]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    found = {name: " ".join(faults) for name, faults in json.loads(done.stdout).items()}
    assert "traceback" in found["fails"]
    assert "exit status 70" in found["fails"]
    assert found["silent"] == "silent"
    assert "took 7" in found["large"]
    assert "control characters" in found["raw"]
    assert "not refused in one line" in found["read"]
    assert "does not name it" in found["unnamed"]
    assert found["sound"] == ""
