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

"""The process of a diagnoser that is a class: ``python -m flea_diag.tools.arena.host PLACE``.

Every line of JSON that comes in is answered by one. What the class prints goes to the error
output, so that it cannot be taken for an answer.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any

NAN = float("nan")


class Host:
    """Hands messages to an object of the class, and what it returns back."""

    def __init__(self, place: str) -> None:
        self._place = place
        self._diagnoser: Any = None
        self._nominal: list[dict[str, Any]] = []

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """The reply to one message."""
        kind = message["kind"]
        if kind == "start":
            self._diagnoser = loaded(self._place)(message["stand"])
            return {"learns": hasattr(self._diagnoser, "learn")}
        if kind == "nominal":
            self._nominal.append(_arrays(message["columns"]))
            return {}
        if kind == "learn":
            self._diagnoser.learn(self._nominal)
            self._nominal = []
            return {}
        if kind == "scan":
            values = {k: NAN if v is None else v for k, v in message["values"].items()}
            return _reply(self._diagnoser.update(message["time_s"], values))
        finish = getattr(self._diagnoser, "finish", None)
        return _reply(finish() if finish is not None else None)


def loaded(place: str) -> Any:
    """The class at FILE.py:CLASS or MODULE:CLASS."""
    module, _, name = place.rpartition(":")
    if not module.endswith(".py"):
        return getattr(importlib.import_module(module), name)
    path = Path(module)
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = made
    spec.loader.exec_module(made)
    return getattr(made, name)


def _arrays(columns: dict[str, list[float | None]]) -> dict[str, Any]:
    import numpy as np

    return {name: np.array(values, dtype=float) for name, values in columns.items()}


def _reply(faults: Any) -> dict[str, Any]:
    return {} if faults is None else {"faults": faults}


def reason(error: Exception) -> str:
    """What was raised, and where."""
    places = traceback.extract_tb(error.__traceback__)
    at = f" ({Path(places[-1].filename).name}:{places[-1].lineno})" if places else ""
    return f"{type(error).__name__}: {error}{at}"


def main() -> int:
    """Answer lines until the input ends."""
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)
    host = Host(sys.argv[1])
    for line in sys.stdin:
        try:
            text = json.dumps(host.answer(json.loads(line)), default=float)
        except Exception as error:  # of whatever kind: it is the entrant's, and ends its run
            text = json.dumps({"failed": reason(error)})
        replies.write(text + "\n")
        replies.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
