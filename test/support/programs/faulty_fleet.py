"""A fleet in whose stages one reading raises an error, as a mistake in their code would."""

from __future__ import annotations

import sys

from flea_diag.nodes.fleet import fleet
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.wire.records import Record, Scan

POISON = 666.0

_handle = ObserverStage.handle


def _failing(self: ObserverStage, record: Record) -> tuple[Record, ...]:
    if isinstance(record, Scan) and POISON in record.values:
        raise ZeroDivisionError("planted")
    return _handle(self, record)


if __name__ == "__main__":
    ObserverStage.handle = _failing  # type: ignore[method-assign]
    sys.exit(fleet.main())
