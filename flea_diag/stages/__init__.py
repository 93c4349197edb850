"""Records in, records out: the one contract between the science and everything around it."""

from __future__ import annotations

from typing import Protocol

from flea_diag.wire.records import Record


class Stage(Protocol):
    """Takes one record and returns the records that it causes.

    Time comes only from record stamps and randomness only from an injected generator, so
    the live graph, the replay and the tests run the same code and give the same answers.
    """

    consumes: tuple[type, ...]

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by ``record``, in the order in which they are to be published."""
        ...
