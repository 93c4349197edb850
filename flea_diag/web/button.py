"""A button of the page with the key that presses it."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui


def button(words: str, key: str, call: Callable[[], None]) -> ui.element:
    """A button that carries its key: the page passes keys to the buttons that can be seen."""
    with ui.element("button").props(f'type=button data-key="{key}"').on("click", call) as element:
        ui.html(f"{words}<kbd>{key}</kbd>", sanitize=False, tag="span")
    return element
