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

"""What the libraries behind the page log: one line each, of characters that a terminal only shows.

They quote the address that somebody asked for, and print how a connection failed as a traceback.
"""

from __future__ import annotations

import logging

from flea_diag.errors import line_of

LIBRARIES = ("asyncio", "engineio", "nicegui", "socketio", "uvicorn", "websockets")
LONGEST = 300
"""Characters of a line."""


class OneLine(logging.Formatter):
    """The message, and of an error its kind and its words."""

    def format(self, record: logging.LogRecord) -> str:
        """Text of one line."""
        words = record.getMessage()
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            words = f"{words}: {type(error).__name__}: {error}"
        words = line_of(words.replace("\n", " "))
        return words if len(words) <= LONGEST else f"{words[: LONGEST - 3]}..."


def show_in_one_line() -> None:
    """Let the libraries log to stderr in this way, in the whole process."""
    handler = logging.StreamHandler()
    handler.setFormatter(OneLine())
    for name in LIBRARIES:
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
