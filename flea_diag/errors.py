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

"""The errors of flea_diag; each message names the item, its value, the limit and the remedy.

FleaError
├── InputError            invalid input (a file, a bag, a message)
│   ├── RecordingError    a .data file or a bag; names file and position
│   ├── ConfigurationError  a YAML file, a parameter or a command-line argument
│   ├── CalibrationError  a calibration that does not fit, or runs unsuitable for calibration
│   ├── WireError         a message without a valid record of its topic
│   └── DiagnoserError    a diagnoser of others that fails, or answers what is none
└── ModelError            a bond graph without valid causality or equations

Every command reports a ``FleaError`` as one line on standard error, with exit status 2; any other
exception is a defect of flea_diag and keeps its traceback.

A message that quotes a value of somebody else quotes it through ``shown``. Whatever people read
in a terminal, log, console, page or report passes ``visible`` where it goes out.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping

LONGEST_SHOWN = 80
"""Characters of a value that a message quotes."""
LONGEST_MESSAGE, LONGEST_END = 1000, 300
"""Characters of a whole message, and of its end where it is longer."""
LONGEST_LIST = 10_000
"""Characters in which a word like the wrong one is looked for."""
LONGEST_INTEGER_BITS = 200
"""Beyond, the digits of a whole number are counted, not written: writing them takes long."""


class FleaError(Exception):
    """Base class of all errors raised intentionally by flea_diag.

    Its words are of bounded length: a file may name itself, and what is in it, by a megabyte.
    """

    def __str__(self) -> str:
        """The message; of a longer one the beginning and the end, which says what to do.

        Where it lists what is known, the known word that is like the wrong one comes last.
        """
        text = super().__str__()
        text += meant(text[:LONGEST_LIST])
        if len(text) <= LONGEST_MESSAGE:
            return text
        return f"{text[: LONGEST_MESSAGE - LONGEST_END - 5]} ... {text[-LONGEST_END:]}"


class InputError(FleaError):
    """Input is invalid."""


class RecordingError(InputError):
    """A recording (.data file or bag) is truncated, of another format, or inconsistent."""


class ConfigurationError(InputError):
    """A configuration file, a parameter or an argument is invalid or outside its limits."""


class CalibrationError(InputError):
    """A calibration does not fit the actuator, or the runs are unsuitable for calibration."""


class WireError(InputError):
    """A message does not contain a valid record of its topic.

    ``kind`` is one of ``layout``, ``size``, ``stamp``, ``names``: messages are counted by it.
    """

    def __init__(self, words: str, kind: str = "layout") -> None:
        super().__init__(words)
        self.kind = kind


class DiagnoserError(InputError):
    """A diagnoser of others raises, ends, hangs, needs too much, or answers what is no answer."""


class ModelError(FleaError):
    """A bond graph has no valid causality, or its equations cannot be formed."""


class InvariantError(FleaError):
    """What must hold for a verdict to be right does not: a defect of the diagnosis."""


def shown(value: object) -> str:
    """Value as an error message quotes it: its literal in at most 80 characters of one line.

    Control and direction characters are escaped, what is longer ends in ``...``. The work is
    bounded too: a value that would fill gigabytes when written out costs no more than another.
    """
    text = ""
    for piece in _pieces(value):
        text += piece
        if len(text) > LONGEST_SHOWN:
            return text[: LONGEST_SHOWN - 3] + "..."
    return text


_UNSEEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Categories of Unicode: control, format, surrogate, and separators of lines and paragraphs."""


_LIST = re.compile(
    r"(?:'([^']+)'|(\S+) is unknown)[^']*?"
    r"(?:known are|choose(?: one)? (?:of|among|from)|nor one of):? ([^;]+)"
)
"""A wrong word, quoted or not, and the list of those that are known, as our messages put them."""


def meant(text: str) -> str:
    """The question whether a known word was meant; empty where none is like the wrong one."""
    found = _LIST.search(text)
    if found is None or "did you mean" in text:
        return ""
    return question(found[1] or found[2], re.findall(r"[^\s,]+", found[3]))


def question(word: str, known: Iterable[str]) -> str:
    """Whether the known word was meant that is most like a mistyped one; empty where none is."""
    close = nearest(word, known)
    return f"; did you mean {close}?" if close else ""


def nearest(word: str, known: Iterable[str]) -> str:
    """The known word that is most like a mistyped one; empty where none is."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(word, list(known), 1, 0.6)), "")


def visible(text: str, kept: str = "\n\t") -> str:
    """Text with each control, direction and format character as its escape in Python.

    A name may hold what moves the cursor, sets the title of a terminal or turns the direction of
    the line around; escaped, it does nothing but look odd.

    Parameters
    ----------
    kept
        Control characters that are meant; none in what is one line.
    """
    if text.isprintable():
        return text
    return "".join(
        c if c in kept or unicodedata.category(c) not in _UNSEEN else _escape(c) for c in text
    )


def line_of(text: object) -> str:
    """Text as one line: its line feeds are escaped, too."""
    return visible(str(text), kept="")


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def _pieces(value: object) -> Iterator[str]:
    """Literal of a value piece by piece; no piece is much longer than what is shown."""
    if isinstance(value, (str, bytes)):
        yield repr(value[: LONGEST_SHOWN + 1])
    elif isinstance(value, Mapping):
        yield "{"
        for number, (key, entry) in enumerate(value.items()):
            yield ", " if number else ""
            yield from _pieces(key)
            yield ": "
            yield from _pieces(entry)
        yield "}"
    elif isinstance(value, (list, tuple, set, frozenset)):
        opening, closing = "[]" if isinstance(value, list) else "()"
        yield opening
        for number, entry in enumerate(value):
            yield ", " if number else ""
            yield from _pieces(entry)
        yield closing
    elif isinstance(value, int) and value.bit_length() > LONGEST_INTEGER_BITS:
        yield f"a whole number of some {round(value.bit_length() * 0.30103)} digits"
    elif isinstance(value, (bool, int, float, type(None))):
        yield repr(value)
    else:
        yield f"{type(value).__name__} {str(value)[: LONGEST_SHOWN + 1]!r}"
