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

"""What the applications of the console share, of one stand as of a hall."""

from __future__ import annotations

from collections.abc import Callable

from textual.app import App
from textual.screen import Screen

from flea_diag.nodes.operator.console_text import CSS


class ScreenApp(App[None]):
    """A Textual application with one main screen, on top of which others open.

    Parameters
    ----------
    make
        Makes the main screen.
    """

    CSS = CSS
    TITLE = "flea_diag"
    ENABLE_COMMAND_PALETTE = False

    def __init__(self, make: Callable[[], Screen[None]]) -> None:
        super().__init__()
        self._make = make

    def get_default_screen(self) -> Screen[None]:
        """The main screen."""
        return self._make()
