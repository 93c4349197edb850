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

"""The digest of a diagnosis: what must change it and what must not."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from typing import Any

import pytest

from flea_diag.stages.digest import Digest, canonical, decision_digest, digest
from flea_diag.wire import records as r

GROUP = r.AmbiguityGroup(
    stamp_ns=10,
    outcome=r.Outcome.ISOLATED,
    episode=1,
    step=2,
    seq=3,
    members=(r.Candidate("jam", "friction+", 1.0, "fits"),),
    dropped=(),
    detected_stamp_ns=8,
    words="the fault is jam",
    calibration_sha256="ab",
    source="live",
    not_observable=(("spall", "no accelerometer"),),
)
DETECTION = r.Detection(8, 1, True, "motor_current", 7.5, 5.0, "z")
SYMBOLS = r.Symbols(8, 1, (r.Symbol("motor_current", "+", "0", 8),))
REQUEST = r.FeatureRequest(9, 1, 1, "std", 1, 9)
VALUE = r.FeatureValue(9, 1, 1, "std", 1, 9, 0.5, "m/s^2", "+", 0.1, 0.2, "", 3.5)
DIAGNOSIS: list[r.Record] = [DETECTION, SYMBOLS, REQUEST, VALUE, GROUP]


def test_the_form_is_canonical_json_hashed_with_sha256() -> None:
    line = (
        '{"detected":true,"episode":1,"record":"Detection","residual":"motor_current",'
        '"stamp_ns":8,"test":"z","threshold":5.0,"z":7.5}'
    )
    assert canonical(DETECTION) == line
    assert digest([DETECTION]) == hashlib.sha256(line.encode() + b"\n").hexdigest()
    assert digest([]) == hashlib.sha256(b"").hexdigest()


@pytest.mark.parametrize(
    "other",
    [
        [*DIAGNOSIS, GROUP, replace(GROUP, seq=99)],
        [*DIAGNOSIS[:-1], replace(GROUP, source="replay")],
        [*DIAGNOSIS[:-1], replace(GROUP, stale=True), GROUP],
        [replace(VALUE, cost_ms=99.0) if each is VALUE else each for each in DIAGNOSIS],
        [r.Scan(1, ("a",), (1.0,)), *DIAGNOSIS, r.Residual(1, (), (), (), ())],
        [GROUP, VALUE, REQUEST, SYMBOLS, DETECTION],
    ],
    ids=["repeats", "source", "stale", "cost", "others", "interleaving"],
)
def test_what_is_no_decision_does_not_matter(other: list[r.Record]) -> None:
    assert digest(other) == digest(DIAGNOSIS)


CHANGES: list[tuple[int, dict[str, Any]]] = [
    (0, {"z": math.nextafter(7.5, 8)}),
    (0, {"stamp_ns": 9}),
    (1, {"symbols": (r.Symbol("motor_current", "+", "+", 8),)}),
    (2, {"feature": "rms"}),
    (3, {"value": math.nan}),
    (4, {"outcome": r.Outcome.DETECTED}),
    (4, {"members": (r.Candidate("jam", "friction+", 0.999, "fits"),)}),
    (4, {"calibration_sha256": "cd"}),
]


@pytest.mark.parametrize(("place", "change"), CHANGES)
def test_every_decision_matters(place: int, change: dict[str, Any]) -> None:
    changed = list(DIAGNOSIS)
    changed[place] = replace(changed[place], **change)
    assert digest(changed) != digest(DIAGNOSIS)


WORDS: list[tuple[int, dict[str, Any]]] = [
    (0, {"test": "window"}),
    (3, {"reason": "no motion", "cost_ms": 1.0}),
    (4, {"words": "a jam", "calibration_sha256": "cd"}),
    (4, {"members": (r.Candidate("jam", "friction+", 1.0, "so", (r.Evidence(1, *"abcd"),)),)}),
    (4, {"dropped": (r.Candidate("spall", "", 0.0, "silent"),), "next_tests": ()}),
    (4, {"not_observable": (("spall", "said otherwise"),)}),
]


@pytest.mark.parametrize(("place", "change"), WORDS)
def test_words_and_hashes_of_files_are_not_in_the_decision_digest(
    place: int, change: dict[str, Any]
) -> None:
    said = list(DIAGNOSIS)
    said[place] = replace(said[place], **change)
    assert decision_digest(said) == decision_digest(DIAGNOSIS)
    assert digest(said) != digest(DIAGNOSIS)


DECIDED: list[tuple[int, dict[str, Any]]] = [
    *(change for change in CHANGES if "calibration_sha256" not in change[1]),
    (4, {"members": (r.Candidate("jam", "friction+", 1.0, "fits", size=0.5, size_sigma=0.1),)}),
    (4, {"stamp_ns": 11}),
    (4, {"not_observable": (("backlash", "no reversal"),)}),
    (3, {"nominal_high": 0.3}),
]


@pytest.mark.parametrize(("place", "change"), DECIDED)
def test_all_that_is_decided_is_in_the_decision_digest(place: int, change: dict[str, Any]) -> None:
    changed = list(DIAGNOSIS)
    changed[place] = replace(changed[place], **change)
    assert decision_digest(changed) != decision_digest(DIAGNOSIS)


def test_a_change_and_back_again_is_two_changes() -> None:
    other = replace(GROUP, outcome=r.Outcome.DETECTED)
    assert digest([GROUP, other, GROUP]) != digest([GROUP])


def test_nan_and_infinity_are_written_alike_each_time() -> None:
    odd = replace(VALUE, value=math.nan, nominal_high=math.inf)
    assert '"value":"nan"' in canonical(odd)
    assert '"nominal_high":"inf"' in canonical(odd)
    whole = Digest()
    whole.add(odd)
    assert whole.hexdigest() == digest([replace(odd, value=-math.nan)])
