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

from __future__ import annotations

from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.records import Detection, Residual, Scan, Symbols

SCAN = Scan(7, ("motor_current",), (1.0,))
RESIDUAL, DETECTION, SYMBOLS = (
    Residual(7, (), (), (), ()),
    Detection(7, 1, True, "", 1.0, 1.0, ""),
    Symbols(7, 1, ()),
)


class Table:
    """Answers by a table; keeps what it was given."""

    def __init__(self, answers, held=(), closed=()):
        self.consumes = tuple(answers)
        self.answers, self.held, self.closed = answers, held, closed
        self.given = []

    def handle(self, record):
        self.given.append(record)
        return self.answers[type(record)]

    def finish(self):
        return self.held

    def reset(self):
        return self.closed


class Silent:
    """A stage that keeps nothing back and has no episode."""

    consumes = (Symbols,)

    def handle(self, record):
        return ()


def test_records_go_to_their_consumers_in_causal_order():
    first = Table({Scan: (RESIDUAL, DETECTION)})
    second = Table({Residual: (), Detection: (SYMBOLS,)})
    both = Pipeline((first, second, Silent()))
    assert both.consumes == (Scan, Residual, Detection, Symbols)
    assert both.handle(SCAN) == (RESIDUAL, DETECTION, SYMBOLS)
    assert second.given == [RESIDUAL, DETECTION]


def test_a_stage_is_fed_by_a_later_one_too():
    first = Table({Scan: (RESIDUAL,), Symbols: ()})
    both = Pipeline((first, Table({Residual: (SYMBOLS,)})))
    assert both.handle(SCAN) == (RESIDUAL, SYMBOLS)
    assert first.given == [SCAN, SYMBOLS]


def test_what_is_held_back_or_closed_goes_the_same_way():
    second = Table({Residual: (SYMBOLS,), Detection: ()})
    both = Pipeline((Table({Scan: ()}, (RESIDUAL,), (DETECTION,)), second, Silent()))
    assert both.finish() == (RESIDUAL, SYMBOLS)
    assert both.reset() == (DETECTION,)
    assert second.given == [RESIDUAL, DETECTION]


def test_records_without_a_consumer_have_no_effect():
    assert Pipeline((Silent(),)).handle(SCAN) == ()
