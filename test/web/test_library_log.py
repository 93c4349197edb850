"""Lines of the libraries behind the page."""

from __future__ import annotations

import logging

import pytest

from flea_diag.web.library_log import LIBRARIES, LONGEST, show_in_one_line


@pytest.fixture
def loggers():
    kept = [(logging.getLogger(name), logging.getLogger(name).handlers) for name in LIBRARIES]
    kept = [(logger, handlers, logger.propagate) for logger, handlers in kept]
    yield
    for logger, handlers, propagate in kept:
        logger.handlers, logger.propagate = handlers, propagate


@pytest.mark.parametrize("name", ["nicegui", "uvicorn.error", "asyncio"])
def test_an_address_is_shown_and_not_obeyed(loggers, capfd, name: str) -> None:
    show_in_one_line()
    logging.getLogger(name).error("http://host/\x00\x1b[2J\n%s not found", "\u202e" + "x" * 9000)
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(r"http://host/\x00\x1b[2J \u202ex")
    assert len(lines[0]) == LONGEST


def test_a_connection_that_fails_is_no_traceback(loggers, capfd) -> None:
    show_in_one_line()
    try:
        raise EOFError("stream ended")
    except EOFError:
        logging.getLogger("uvicorn.error").exception("Exception in ASGI application\n")
    assert capfd.readouterr().err == "Exception in ASGI application : EOFError: stream ended\n"
