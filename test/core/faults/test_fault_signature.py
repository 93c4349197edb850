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

"""The matching table, entry by entry."""

from __future__ import annotations

import pytest

from flea_diag.core.faults.fault_signature import FaultSignature, compatible, signature

# Predicted -> for each observed (magnitude, slope) whether it fits where jumps are visible.
VISIBLE = {
    "0+": {"++": True, "+0": True, "+?": True, "+-": False, "-?": False, "-+": False},
    "++": {"++": True, "+0": False, "+?": True, "+-": False, "-?": False},
    "+-": {"++": False, "+0": False, "+?": True, "+-": True, "-?": False},
    "+0": {"++": False, "+0": True, "+?": True, "+-": False, "-?": False},
    "0-": {"--": True, "-0": True, "-?": True, "-+": False, "+?": False, "*?": True},
    "-+": {"-+": True, "-?": True, "--": False, "+?": False},
    "00": {"+?": False, "-?": False, "+0": False, "-+": False, "*?": False},
    "**": {"++": True, "+-": True, "-0": True, "-?": True},
    "+*": {"++": True, "+-": True, "+0": True, "-0": False},
    "0*": {"++": True, "--": True},
}
CASES = [(p, o, fits) for p, row in VISIBLE.items() for o, fits in row.items()]


@pytest.mark.parametrize(("predicted", "observed", "fits"), CASES)
def test_where_jumps_are_visible(predicted: str, observed: str, fits: bool) -> None:
    found = compatible(FaultSignature(*predicted, 0, ""), *observed, jump_visible=True)
    assert bool(found) is fits
    assert predicted in found.reason


@pytest.mark.parametrize("predicted", ["0+", "++", "+0"])
@pytest.mark.parametrize(("observed", "fits"), [("++", True), ("+0", True), ("+-", False)])
def test_where_a_jump_looks_like_a_fast_rise(predicted: str, observed: str, fits: bool) -> None:
    assert bool(compatible(FaultSignature(*predicted, 0, ""), *observed)) is fits


@pytest.mark.parametrize("predicted", VISIBLE)
@pytest.mark.parametrize("observed", ["0?", "00", "??"])
def test_a_normal_residual_refutes_nothing(predicted: str, observed: str) -> None:
    assert compatible(FaultSignature(*predicted, 0, ""), *observed, jump_visible=True)


@pytest.mark.parametrize(
    ("signs", "text", "direction"),
    [
        ("000", "00", "0"),
        ("0-+", "0-(1)", "-"),
        ("00+", "0+(2)", "+"),
        ("-+0", "-+(0)", "-"),
        ("+00", "+0(0)", "+"),
        ("0*-", "0*(1)", "*"),
    ],
)
def test_two_symbols_of_a_sequence(signs: str, text: str, direction: str) -> None:
    found = signature(signs, "")
    assert (str(found), found.direction) == (text, direction)
