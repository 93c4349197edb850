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

"""The table of laws says what the laws do."""

from __future__ import annotations

import math
import re

import pytest

from flea_diag.core.bond_graph.law import LAWS
from flea_diag.core.bond_graph.law_table import ROWS, law_lines
from flea_diag.core.symbolic.expression import Variable, evaluate

FUNCTIONS = {"tanh": math.tanh, "exp": math.exp, "sin": math.sin, "cos": math.cos}
EFFORTS = [n for n, law in LAWS.items() if law.effort and n != "stretch_and_play"]


def test_every_law_has_a_row_and_every_parameter_is_in_it() -> None:
    assert list(ROWS) == [name for name in LAWS if name in ROWS] or set(ROWS) == set(LAWS)
    for line in list(law_lines())[2:]:
        name = re.match(r"\| `(\w+)`", line)[1]  # type: ignore[index]
        assert all(f"`{role}`" in line for role in LAWS[name].roles), name


@pytest.mark.parametrize("name", EFFORTS)
def test_the_equation_for_people_gives_what_runs(name: str) -> None:
    """The text, read as arithmetic, against the formula, at one point."""
    law, point = LAWS[name], {"f": -0.7, "q": -0.7, "by": -3.0}
    point |= {role: 0.3 + 0.2 * place for place, role in enumerate(law.roles)}
    said = ROWS[name].equation.split("= ", 1)[1].replace("^", "**")
    said = re.sub(r"\|(\w+)\|", r"abs(\1)", said)
    said = re.sub(r"(?<=[\w)]) (?=[a-z(])(?!\()", " * ", said)
    said = re.sub(r"(?<=[\w)]) (?=\()", " * ", said)
    wanted = eval(said, {**FUNCTIONS, "abs": abs}, point)
    assert law.effort is not None
    made = law.effort(Variable("f"), {role: Variable(role) for role in (*law.roles, "by")})
    assert evaluate(made, point) == pytest.approx(wanted)
