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

"""What stands in place of a result where there is none."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

from flea_diag.errors import FleaError

Result = TypeVar("Result")
DIED = "the process died: killed, out of memory, or a crash in a library"


class Refused(NamedTuple):
    """In place of a result: why there is none."""

    words: str


def refusing(work: Callable[[], Result]) -> Result | Refused:
    """What the work returns, or the words of the error with which it refuses its input."""
    try:
        return work()
    except FleaError as error:
        return Refused(str(error))


def why_failed(error: Exception) -> str:
    """What a line says that has no result; of a defect also where it is."""
    if isinstance(error, FleaError):
        return str(error) or "failed without a message"
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
