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

"""The stands of a fleet as the parameter ``stands`` lists them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from flea_diag.configuration.files import DEFAULT_STAND
from flea_diag.errors import ConfigurationError, shown

NAMESPACE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")
MOST_STANDS = 256


@dataclass(frozen=True)
class StandEntry:
    """One stand: ``NAMESPACE[=STAND[@CALIBRATION]]``.

    Parameters
    ----------
    namespace
        Of its topics, relative to that of the fleet.
    stand
        Name of a shipped stand, or the folder of one.
    calibration
        File; empty: that of the stand.
    """

    namespace: str
    stand: str = DEFAULT_STAND
    calibration: str = ""

    @property
    def files(self) -> tuple[str, str]:
        """What it is built from; stands with the same share what is known of them."""
        return self.stand, self.calibration


def stand_entries(texts: Sequence[str]) -> tuple[StandEntry, ...]:
    """Entries of a list of stands.

    Raises
    ------
    ConfigurationError
        There is none, one has no valid namespace, or two have the same.
    """
    if not texts:
        raise ConfigurationError(
            "stands = [] names no stand: give their namespaces, for example "
            "-p stands:=\"['bay_1', 'bay_2=./mine']\""
        )
    if len(texts) > MOST_STANDS:
        raise ConfigurationError(f"stands has {len(texts)} entries, at most {MOST_STANDS} are run")
    entries = tuple(map(_entry, texts))
    seen: set[str] = set()
    for entry in entries:
        if entry.namespace in seen:
            raise ConfigurationError(
                f"stands: the namespace {shown(entry.namespace)} occurs twice; each stand needs "
                "one of its own"
            )
        seen.add(entry.namespace)
    return entries


def _entry(text: str) -> StandEntry:
    name, _, files = text.partition("=")
    stand, _, calibration = files.partition("@")
    namespace = name.strip("/")
    if not NAMESPACE.fullmatch(namespace):
        raise ConfigurationError(
            f"stands: {shown(text)} is no NAMESPACE[=STAND[@CALIBRATION]]: a namespace has "
            "letters, digits and _, and begins with a letter"
        )
    return StandEntry(namespace, stand or DEFAULT_STAND, calibration)
