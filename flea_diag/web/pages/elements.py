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

"""Elements of ours that run in the browser, and the blocks that they stand in."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

STATIC = Path(__file__).parents[1] / "static"


class PanelBody(ui.element, component=STATIC / "panel.js"):
    """Content of a panel, drawn by the server."""

    def show(self, content: str) -> None:
        """Send the content, unless it is what stands there."""
        if self.props.get("content") != content:
            self.props["content"] = content
            self.update()


class Strips(
    ui.element, component=STATIC / "strip_charts.js", esm={"uplot": str(STATIC / "uplot")}
):
    """Strip charts of one kind."""


class Watch(ui.element, component=STATIC / "watch.js"):
    """Monitors the connection and the keyboard."""


def section(name: str, css: str, key: str, title: str) -> ui.element:
    """A panel with its title and the key that leads to it."""
    block = ui.element("section").classes(f"panel {css}")
    block.props(f'id=panel-{name} tabindex=-1 data-key="{key}"')
    if title:
        block.props["aria-label"] = title
    if title:
        with block:
            ui.html(title, sanitize=False, tag="h2")
    return block
