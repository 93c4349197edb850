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

"""The texts of the screens in the language of whoever reads them.

The code says them in English, as ``tr("{count} kept", count=3)``; a catalogue has for each the same
in another language. A text of a record (a name, a sentence of the diagnosis) is shown as it came,
unless the catalogue has exactly this text.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

ENGLISH = "en"


def later(text: str) -> str:
    """A text of a table, which ``tr`` is asked for where it is shown."""
    return text


RECORDED = (
    later("live"), later("replay"), later("good"), later("bad"), later("stale"),
    later("saturated"), later("absent"), later("running"), later("waiting"), later("residual"),
    later("channel"), later("variable"), later("shelved"), later("unshelved"),
    later("out of service"), later("in service"), later("acknowledgement withdrawn"),
    later("unit accepted"), later("unit rejected"), later("feature"), later("motion"),
    later("load"), later("no deviation"), later("lost"), later("late"), later("missing"),
)  # fmt: skip
"""Words of records for which every language has its own."""


class _Spoken:
    """The language of this process: a screen has one, whichever thread draws it."""

    language = ENGLISH
    texts: Mapping[str, str] = {}


def tr(text: str, /, **values: object) -> str:
    """A text in the language that is spoken, its places in braces filled with ``values``."""
    found = _Spoken.texts.get(text, text)
    return found.format(**values) if values else found


def language() -> str:
    """Code of the language that is spoken, as ``lang`` of HTML has it."""
    return _Spoken.language


def speak(code: str, texts: Mapping[str, str]) -> None:
    """From now on speak this language; ``texts`` are by their English."""
    _Spoken.language, _Spoken.texts = code, texts


@contextmanager
def speaking(code: str, texts: Mapping[str, str]) -> Iterator[None]:
    """Speak this language for a while."""
    before = _Spoken.language, _Spoken.texts
    speak(code, texts)
    try:
        yield
    finally:
        speak(*before)
