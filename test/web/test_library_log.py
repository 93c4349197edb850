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
