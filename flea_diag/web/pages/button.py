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

"""A button of the page with its keyboard shortcut."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from flea_diag.web.markup import joined, tag


def button(
    words: str, key: str = "", call: Callable[[], None] | None = None, **data: str
) -> ui.element:
    """A button with its shortcut in ``data-key``: the page forwards keys to visible buttons.

    ``data`` are further attributes, by which the browser does something by itself: ``opens`` names
    a dialog.
    """
    with ui.element("button") as element:
        element.props["type"] = "button"
        if key:
            element.props["data-key"] = element.props["aria-keyshortcuts"] = key
        for name, value in data.items():
            element.props[f"data-{name}"] = value
        if call is not None:
            element.on("click", call)
        shortcut = tag("kbd", key, aria_hidden="true") if key else None
        ui.html(str(joined(words, shortcut)), sanitize=False, tag="span")
    return element
