"""Several stages as one: what one of them returns is handed on to those that consume it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from flea_diag.stages import Stage
from flea_diag.wire.records import Record


class Pipeline:
    """A stage made of stages; drives replay, tests and the one-process diagnoser alike.

    ``handle`` returns every record that ``record`` caused, in causal order, each before
    the records that it caused in turn.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = tuple(stages)
        self.consumes: tuple[type, ...] = tuple(
            dict.fromkeys(kind for stage in self._stages for kind in stage.consumes)
        )

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Run ``record`` and all that follows from it through the stages that consume it."""
        return self._run(deque([record]))

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: stages that still hold records back let them go."""
        caused: list[Record] = []
        for stage in self._stages:
            held: tuple[Record, ...] = getattr(stage, "finish", tuple)()
            caused.extend(held)
            caused.extend(self._run(deque(held)))
        return tuple(caused)

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode and arm again, in every stage that keeps one."""
        caused: list[Record] = []
        for stage in self._stages:
            closed: tuple[Record, ...] = getattr(stage, "reset", tuple)()
            caused.extend(closed)
            caused.extend(self._run(deque(closed)))
        return tuple(caused)

    def _run(self, waiting: deque[Record]) -> tuple[Record, ...]:
        caused: list[Record] = []
        while waiting:
            current = waiting.popleft()
            for stage in self._stages:
                if type(current) in stage.consumes:
                    produced = stage.handle(current)
                    caused.extend(produced)
                    waiting.extend(produced)
        return tuple(caused)
