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

"""A fleet in whose stages one reading raises an error, as a mistake in their code would."""

from __future__ import annotations

import sys

from flea_diag.nodes.main import main
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
    sys.exit(main(["fleet", *sys.argv[1:]]))
