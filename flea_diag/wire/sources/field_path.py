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

"""A field of a message of any type: ``effort[elbow]``, ``wrench.force.z``, ``data[3]``.

In brackets stands the number of an element or its name. A name is looked up in the list of texts
beside the array, as ``name`` of a JointState, or of the whole message, as ``joint_names`` of a
JointTrajectoryControllerState, or among the elements' own ``name`` or ``key``. The
messages are those of rclpy or of rosbags: anything with attributes of the names of the fields.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from flea_diag.errors import ConfigurationError, WireError, shown

LONGEST_PATH = 300
MOST_NAMES = 8
"""Names that a message lists."""
_STEP = re.compile(r"([A-Za-z_]\w*)(?:\[([^\[\]]+(?:\[[^\[\]]*\][^\[\]]*)*)\])?")
_KEYS = ("name", "key")
"""Fields by which an element of an array of messages is named."""


@dataclass(frozen=True, slots=True)
class FieldPath:
    """Steps from a message to one number: field, and element or "" ."""

    text: str
    steps: tuple[tuple[str, str], ...]

    @classmethod
    def parsed(cls, text: str, where: str) -> FieldPath:
        """Path from its text.

        Raises
        ------
        ConfigurationError
            It is no path.
        """
        steps, place = [], 0
        while place <= len(text) <= LONGEST_PATH:
            found = _STEP.match(text, place)
            if found is None:
                break
            steps.append((found[1], found[2] or ""))
            place = found.end()
            if place == len(text):
                return cls(text, tuple(steps))
            if text[place] != ".":
                break
            place += 1
        raise ConfigurationError(
            f"{where}: field = {shown(text)} is no field of a message: write it like "
            "temperature, wrench.force.z, data[3] or effort[elbow]"
        )

    def __str__(self) -> str:
        return self.text

    def read(self, message: Any) -> float | None:
        """The number; None where the message has no such element.

        Raises
        ------
        WireError
            The message has no such field, or it is no number.
        """
        value = self.value(message)
        return None if value is None else self._number(value)

    def value(self, message: Any) -> Any:
        """What stands there, a number or an array; None where the message has no such element.

        Raises
        ------
        WireError
            The message has no such field.
        """
        root = message
        for name, key in self.steps:
            value = getattr(message, name, None)
            if value is None:
                has = ", ".join(fields_of(message)[:MOST_NAMES])
                raise WireError(f"no field {shown(name)} in {shown(self.text)}, it has {has}")
            if key:
                at = _index(message, value, key, root)
                if at is None:
                    return None
                value = value[at]
            message = value
        return message

    def _number(self, value: Any) -> float:
        try:
            return float(value)
        except (TypeError, ValueError):
            pass
        if hasattr(value, "__len__") and not isinstance(value, str):
            raise WireError(f"{self.text} is an array: choose one element, as {self.text}[0]")
        raise WireError(f"{self.text} is {shown(value)[:40]}, which is no number")

    def names_in(self, message: Any) -> tuple[str, ...]:
        """Names that the elements of the last array have in this message, as far as they go."""
        names: tuple[str, ...] = ()
        root = message
        for name, key in self.steps:
            value = getattr(message, name, None)
            if key and value is not None:
                names = tuple(_names(message, value, root))
                at = _index(message, value, key, root)
                value = None if at is None else value[at]
            if value is None:
                break
            message = value
        return names


def fields_of(message: Any) -> tuple[str, ...]:
    """Names of the fields of a message."""
    known = getattr(message, "__dataclass_fields__", None)
    if known is None:
        listed = getattr(message, "get_fields_and_field_types", None)
        known = listed() if listed is not None else ()
    return tuple(name for name in known if not name.startswith("__"))


def _index(message: Any, values: Any, key: str, root: Any) -> int | None:
    """Place of an element given by number or name; None if it is not there."""
    if not hasattr(values, "__len__") or isinstance(values, str):
        raise WireError(f"[{key}]: the field is no array")
    if key.isdecimal():
        return int(key) if len(key) < 10 and int(key) < len(values) else None
    names = _names(message, values, root)
    at = names.index(key) if key in names else None
    return at if at is not None and at < len(values) else None


def _names(message: Any, values: Any, root: Any) -> Sequence[str]:
    """Names of the elements: their own, of the list of texts beside them, or of the message's."""
    if len(values) and not isinstance(values[0], str):
        for key in _KEYS:
            if isinstance(getattr(values[0], key, None), str):
                return [getattr(value, key) for value in values]
    for each in (message, root):
        for name in fields_of(each):
            listed = getattr(each, name)
            is_of_texts = isinstance(listed, list) and listed and isinstance(listed[0], str)
            if is_of_texts and (each is message or len(listed) == len(values)):
                names: Sequence[str] = listed
                return names
    return ()
