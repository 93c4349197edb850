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
