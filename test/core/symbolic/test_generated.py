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

"""What a generated function is known by: its own text, by which compiled code is kept."""

from __future__ import annotations

from flea_diag.core.symbolic.generated import compiled

INNER = "def inner(p, x):\n    return x[0] + 1.0\n\n\n"
OUTER = "def outer(p, x):\n    return (\n        inner(p, x),\n    )\n\n\n"
OTHER = "def other(p, x):\n    return x[0]\n\n\n"


def test_a_function_is_the_same_beside_any_others() -> None:
    alone, beside = compiled(INNER), compiled(f"{OTHER}{INNER}")
    assert alone["inner"].source == beside["inner"].source == INNER.rstrip("\n") + "\n"
    assert beside["other"].source != beside["inner"].source


def test_what_a_function_calls_is_a_part_of_it() -> None:
    made = compiled(f"{INNER}{OTHER}{OUTER}")
    changed = compiled(f"{INNER.replace('1.0', '2.0')}{OTHER}{OUTER}")
    assert made["outer"].source != changed["outer"].source
    assert made["other"].source == changed["other"].source
    assert "def inner" in made["outer"].source
    assert "def other" not in made["outer"].source
    assert made["outer"](None, [1.0]) == (2.0,)


def test_a_function_that_calls_itself_is_there_once() -> None:
    text = "def again(p, x):\n    return again(p, x[1:]) if x else 0.0\n"
    assert compiled(text)["again"].source == text
