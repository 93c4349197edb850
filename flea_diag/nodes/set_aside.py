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

"""A file of a stand's state that is damaged is moved beside: work goes on, nothing is deleted."""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime, timezone
from itertools import count
from pathlib import Path


def set_aside(path: Path, companions: tuple[str, ...] = ()) -> Path:
    """Rename a file to ``NAME.damaged-DATE`` in its folder and return the new path.

    Parameters
    ----------
    companions
        Endings of files that belong to it and go with it, where they exist.

    Raises
    ------
    OSError
        It cannot be renamed.
    """
    now = f"{datetime.now(timezone.utc):%Y-%m-%dT%H%M%SZ}"
    names = (f"{path.name}.damaged-{now}{f'-{n}' if n else ''}" for n in count())
    target = next(each for each in map(path.with_name, names) if not each.exists())
    path.rename(target)
    for ending in companions:
        with suppress(FileNotFoundError):
            path.with_name(path.name + ending).rename(target.with_name(target.name + ending))
    return target
