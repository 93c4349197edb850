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

"""HTML and SVG as text; all content from records is escaped, control characters made visible."""

from __future__ import annotations

from datetime import datetime, timezone

from markupsafe import Markup, escape

from flea_diag.errors import visible
from flea_diag.operator.panel import clock
from flea_diag.wire.records import NEVER_NS, SECOND_NS

__all__ = ["Markup", "joined", "moment", "path", "tag", "text"]


def tag(name: str, *children: object, **attributes: object) -> Markup:
    """One element; children and attribute values are escaped unless they are markup.

    ``class_`` and ``for_`` lose their underscore, others get a hyphen for it; an attribute
    whose value is None is left out.
    """
    given = Markup().join(
        Markup(' {}="{}"').format(key.rstrip("_").replace("_", "-"), _escaped(value))
        for key, value in attributes.items()
        if value is not None
    )
    return Markup("<{0}{1}>{2}</{0}>").format(Markup(name), given, joined(*children))


def joined(*children: object) -> Markup:
    """Children one after another, escaped unless they are markup."""
    return Markup().join(_escaped(child) for child in children if child is not None)


def _escaped(child: object) -> Markup:
    return child if isinstance(child, Markup) else escape(visible(str(child)))


def text(x: float, y: float, words: object, class_: str = "", anchor: str = "start") -> Markup:
    """SVG text at a point."""
    given = class_ or None
    return tag("text", words, x=f"{x:.1f}", y=f"{y:.1f}", class_=given, text_anchor=anchor)


def path(commands: str, class_: str, *children: object) -> Markup:
    """SVG path."""
    return tag("path", *children, d=commands, class_=class_)


def moment(stamp_ns: int, digits: int = 1, class_: str = "") -> Markup:
    """Time of day in UTC, to which the browser adds its local time; a dash for none."""
    words = f"{clock(stamp_ns, digits)} UTC"
    if stamp_ns == NEVER_NS:
        return tag("span", words, class_=class_ or None)
    at = datetime.fromtimestamp(stamp_ns // SECOND_NS, tz=timezone.utc)
    return tag("time", words, datetime=f"{at:%Y-%m-%dT%H:%M:%SZ}", class_=class_ or None)
