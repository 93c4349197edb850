"""Of two publishers of a stream the first is used as long as it delivers."""

from __future__ import annotations

import pytest

from flea_diag.wire.bus.numbered.one_source import MOST_LOST, SILENT_S, OneSource


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
