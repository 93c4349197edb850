"""A button of the page with its keyboard shortcut."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui


def button(words: str, key: str, call: Callable[[], None]) -> ui.element:
    """A button with its shortcut in ``data-key``: the page forwards keys to visible buttons."""
    with ui.element("button").props(f'type=button data-key="{key}"').on("click", call) as element:
        ui.html(f"{words}<kbd>{key}</kbd>", sanitize=False, tag="span")
    return element
