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

"""Equations of the pages as MathML, which browsers draw by themselves: no script, no font.

``pymdownx.arithmatex`` finds ``$...$`` and ``$$...$$``; this hook of MkDocs converts what it found.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

FOUND = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)


BAR, TIGHT = "<mo>&#x0007C;</mo>", '<mo lspace="0" rspace="0">|</mo>'
"""The bar of an absolute value; browsers set an operator apart from what stands beside it."""


def mathml(found: re.Match[str]) -> str:
    """One equation; a display of its own where it was a paragraph."""
    latex = html.unescape(found["latex"]).strip().replace("{aligned}", "{align*}")
    if found["tag"] == "span":
        return convert(latex).replace(BAR, TIGHT)
    drawn = convert(latex, display="block").replace(BAR, TIGHT)
    return f'<div class="equation" tabindex="0">{drawn}</div>'


def on_page_content(content: str, **_: Any) -> str:
    """Convert the equations of one page."""
    return FOUND.sub(mathml, content)
