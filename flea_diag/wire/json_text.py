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

"""JSON of others, read safely: of bounded size, depth and number of values, one kind of error.

``[[],[],...`` takes twenty times its length when it is made, and digits without end take hours.
A document is therefore measured as text, by a few passes in C, before anything is made of it.
``record_fields`` then reads what was made, field by field.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from itertools import accumulate
from typing import Any, NoReturn

from flea_diag.errors import shown
from flea_diag.wire.yaml_text import DEEPEST, LARGEST_TEXT, LONGEST_NUMBER, MOST_VALUES

_NUMBER = re.compile(f"[-+.0-9eE]{{{LONGEST_NUMBER + 1}}}")
_NO_BRACKET = re.compile(r"[^][{}]+")
_STEP = {"[": 1, "{": 1, "]": -1, "}": -1}


def parse_json(
    text: str,
    *,
    largest: int = LARGEST_TEXT,
    most_values: int = MOST_VALUES,
    finite: bool = True,
) -> Any:
    """What a text says.

    Parameters
    ----------
    largest, most_values
        Limits of characters and values.
    finite
        Refuse ``NaN`` and ``Infinity``, which Python writes and JSON does not know.

    Raises
    ------
    ValueError
        It is no JSON or exceeds a limit, in one line with the place; the text is not quoted.
    """
    if len(text) > largest:
        raise ValueError(f"{len(text)} characters, at most {largest} are read")
    _measure(text, most_values)
    try:
        return (_STRICT if finite else _OF_PYTHON).decode(text)
    except json.JSONDecodeError as error:
        place = f"(line {error.lineno}, column {error.colno})"
        raise ValueError(f"not valid JSON: {error.msg} {place}") from None
    except RecursionError:
        raise ValueError(f"nested deeper than {DEEPEST} levels") from None


def _measure(text: str, most_values: int) -> None:
    """Refuse what would take much memory or time, by what stands outside of quotes."""
    unescaped = text.replace("\\\\", "").replace('\\"', "")
    if unescaped.count('"') > 4 * most_values:
        _refuse_many(most_values)
    plain = "".join(unescaped.split('"')[::2])
    if plain.count(",") + plain.count("[") + plain.count("{") > most_values:
        _refuse_many(most_values)
    levels = accumulate(map(_STEP.__getitem__, _NO_BRACKET.sub("", plain)))
    if max(levels, default=0) > DEEPEST:
        raise ValueError(f"nested deeper than {DEEPEST} levels")
    if _NUMBER.search(plain):
        raise ValueError(f"a number of more than {LONGEST_NUMBER} characters")


def _each_key_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {shown(twice)} occurs twice")
    return found


def _refuse_many(most_values: int) -> NoReturn:
    raise ValueError(f"more than {most_values} values")


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number of JSON")


_STRICT = json.JSONDecoder(parse_constant=_refuse_constant, object_pairs_hook=_each_key_once)
_OF_PYTHON = json.JSONDecoder(object_pairs_hook=_each_key_once)
