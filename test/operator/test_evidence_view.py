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

"""A size over time on the screens, as the record says it."""

from __future__ import annotations

import re
from dataclasses import replace

from support.verdicts import NOMINAL, START, group, shown

from flea_diag.operator.evidence_view import growth
from flea_diag.operator.panel import clock
from flea_diag.operator.view import page, view
from flea_diag.web.size_chart import size_chart
from flea_diag.wire.records import NEVER_NS, Level, Outcome, SizeAt, SizeTrend

SECOND_NS = 10**9
ISOLATED = group(Outcome.ISOLATED, "winding_short")
TOLD = SizeTrend(
    START + 80 * SECOND_NS,
    1,
    "winding_short",
    "resistance lost",
    "ohm",
    tuple(SizeAt(START + (10 + 20 * k) * SECOND_NS, 0.25 + 0.05 * k, 0.01) for k in range(4)),
    0.41,
    0.03,
    "grows",
    0.0025,
    0.0002,
    0.9,
    START + 240 * SECOND_NS,
    START + 280 * SECOND_NS,
    START + 330 * SECOND_NS,
    0.0,
    0.0,
)


def test_growth_and_the_end_it_leads_to() -> None:
    state = shown(ISOLATED, TOLD)
    panel = growth(state)
    assert panel is not None
    said = panel.text()
    assert "winding_short, resistance lost" in said
    assert "0.410 ± 0.030 ohm, grows: 0.150 ± 0.012 ohm a minute" in said
    for at in (TOLD.median_ns, TOLD.low_ns, TOLD.high_ns):
        assert clock(at) in said
    assert panel.lines[0].level is Level.WARN
    assert said in page(view(state, START)).replace("\n  ", "\n")


def test_what_is_not_foretold_is_not_said() -> None:
    for limit, words in ((float("nan"), "no limit is stated"), (0.9, "no end is foretold")):
        told = replace(TOLD, limit=limit, median_ns=NEVER_NS, low_ns=NEVER_NS, high_ns=NEVER_NS)
        panel = growth(shown(ISOLATED, told))
        assert panel is not None
        assert words in panel.text()
        assert "reached" not in panel.text()
    crossed = growth(shown(ISOLATED, replace(TOLD, crossed=0.8)))
    assert crossed is not None
    assert "is crossed, with probability 80%" in crossed.text()
    assert crossed.lines[0].level is Level.ERROR


def test_of_another_episode_nothing_is_shown() -> None:
    assert growth(shown(TOLD)) is None
    assert growth(shown(ISOLATED, replace(TOLD, episode=2))) is None
    assert growth(shown(ISOLATED, TOLD, NOMINAL)) is None


def test_the_picture_has_a_bar_a_size_and_its_end_on_the_limit() -> None:
    drawn = str(size_chart(TOLD))
    (bars,) = re.findall(r'd="([^"]*)" class="band"', drawn)
    assert bars.count("M") == len(TOLD.sizes)
    (end,) = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', drawn)
    (limit,) = re.findall(r'd="M[\d.]+ ([\d.]+)H[\d.]+" class="limit"', drawn)
    assert end[1] == limit
    (low, high) = re.findall(r'd="M([\d.]+) [\d.]+H([\d.]+)" class="foretold"', drawn)[0]
    assert float(low) < float(end[0]) < float(high)
    hostile = replace(TOLD, fault="<img src=x>")
    assert "<img" not in str(size_chart(hostile))
