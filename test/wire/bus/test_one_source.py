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

"""Of two publishers of a stream the first is used as long as it delivers."""

from __future__ import annotations

import pytest

from flea_diag.wire.bus.numbered.one_source import MOST_LOST, SILENT_S, OneSource
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.records import Scan


class Graph:
    """A source gate with a clock and a number of writers that the test sets."""

    def __init__(self, writers: int = 2) -> None:
        self.writers, self.now_s = writers, 0.0
        self.gate = OneSource(lambda: self.writers, lambda: self.now_s)

    def admits(self, *numbers: int) -> list[bool]:
        return [self.gate.admits(number) for number in numbers]


def test_one_writer_may_begin_anew_and_lose_what_it_likes() -> None:
    assert all(Graph(writers=1).admits(7, 8, 40_000, 1, 2))


@pytest.mark.parametrize("other", [1, 300, 90_000])
def test_a_second_writer_is_told_by_its_numbers(other: int) -> None:
    mixed = [n for k in range(20) for n in (500 + k, other + k)]
    assert Graph().admits(*mixed) == [True, False] * 20


def test_two_that_began_together_are_told_by_their_order() -> None:
    mixed = [n for k in range(20) for n in (100 + k, 100 + k)]
    assert Graph().admits(*mixed) == [True, False] * 20


def test_numbers_that_the_source_in_use_lost_are_bridged() -> None:
    assert Graph().admits(500, 900, 503, 901, 503 + MOST_LOST + 1, 902, 505 + 2 * MOST_LOST) == [
        True, False, True, False, True, False, True,
    ]  # fmt: skip


def test_another_source_is_taken_once_the_first_is_silent_or_gone() -> None:
    graph = Graph()
    assert graph.admits(500, 7) == [True, False]
    graph.now_s = SILENT_S
    assert graph.admits(8) == [False]
    graph.now_s += 0.01
    assert graph.admits(9, 10, 501) == [True, True, False]
    gone = Graph()
    assert gone.admits(500, 7) == [True, False]
    gone.writers = 1
    assert gone.admits(8, 9) == [True, True]


PERIOD_NS = 10_000_000


def sent(number: int, place_ns: int) -> tuple[int, bytes]:
    """A message of a source at this place within the period, with its number."""
    return number, encode(Scan(10**18 + number * PERIOD_NS + place_ns, ("motor_current",), (0.0,)))


def test_two_of_the_same_numbers_are_told_by_the_places_of_their_stamps() -> None:
    """Started together, and either may come first."""
    graph = Graph()
    first, second = ([sent(k, place_ns) for k in range(40)] for place_ns in (0, 5_000_000))
    assert [graph.gate.admits(*message) for message in first[:4]] == [True] * 4
    for k in range(4, 40):
        order = (first[k], second[k]) if k % 3 else (second[k], first[k])
        taken = [message for message in order if graph.gate.admits(*message)]
        assert taken == [first[k]]


def test_numbers_that_cross_do_not_mix_the_sources() -> None:
    """The second is faster: it catches up, and goes on ahead."""
    graph = Graph()
    first = [(20 * k, "first", sent(50 + k, 0)) for k in range(100)]
    slow = [(at, name, (n, _every_second(data, n))) for at, name, (n, data) in first]
    fast = [(10 * k + 3, "fast", sent(k, 3_000_000)) for k in range(200)]
    taken = {name for _, name, message in sorted(slow + fast) if graph.gate.admits(*message)}
    assert taken == {"first"}


def _every_second(_data: bytes, number: int) -> bytes:
    """The stamp of a source of half the rate."""
    return encode(Scan(10**18 + number * 2 * PERIOD_NS, ("motor_current",), (0.0,)))


def test_two_at_the_same_place_are_both_refused() -> None:
    """Started together on one clock: whichever comes first would be taken, in turns."""
    graph = Graph()
    messages = [sent(k, place_ns) for k in range(60) for place_ns in (0, 100_000)]
    taken = [graph.gate.admits(*message) for message in messages]
    assert not any(taken[8:])
    graph.writers = 1
    assert graph.gate.admits(*sent(60, 0))
