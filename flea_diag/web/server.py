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

"""Serves the page from a thread of its own, since the node's thread runs the ROS executor."""

from __future__ import annotations

import socket
import threading
from typing import Any

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import PlainTextResponse
from nicegui import app as pages
from nicegui import ui

from flea_diag.errors import ConfigurationError
from flea_diag.operator.words import language
from flea_diag.web.connection import MOST_CONNECTIONS, PatientProtocol
from flea_diag.web.guard import Guard, is_loopback
from flea_diag.web.library_log import show_in_one_line
from flea_diag.web.socket_gate import LONGEST_MESSAGE

END_S = 3.0
LIBRARY: dict[str, Any] = {"de": "de-DE"}
"""Our language -> that of the library, for what it says itself; of others English."""
KEPT_MESSAGES = 200
"""Messages buffered for a browser that is disconnected; beyond that it reloads the page."""


class Server:
    """A web server that runs until it is closed.

    Raises
    ------
    ConfigurationError
        The address or port cannot be used.
    """

    def __init__(self, title: str, address: str, port: int, token: str) -> None:
        show_in_one_line()
        inner = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        ui.run_with(
            inner,
            title=title,
            dark=None,
            language=LIBRARY.get(language(), "en-US"),
            tailwind=False,
            binding_refresh_interval=None,
            message_history_length=KEPT_MESSAGES,
            show_welcome_message=False,
        )
        pages.exception_handler(404)(_nothing_here)
        guarded: Any = Guard(inner, token, local_only=is_loopback(address))
        self._socket = _bound(address, port)
        self.port = int(self._socket.getsockname()[1])
        self._server = uvicorn.Server(
            uvicorn.Config(
                guarded,
                log_config=None,
                log_level="error",
                access_log=False,
                lifespan="on",
                ws_per_message_deflate=False,  # not worth its CPU for a few kB/s
                timeout_graceful_shutdown=1,
                http=PatientProtocol,
                proxy_headers=False,  # X-Forwarded-For is what anybody on this machine writes
                limit_concurrency=MOST_CONNECTIONS,
                ws_max_size=LONGEST_MESSAGE,
            )
        )
        self._thread = threading.Thread(
            target=self._server.run, args=([self._socket],), name="web", daemon=True
        )

    def start(self) -> None:
        """Start serving."""
        self._thread.start()

    def close(self) -> None:
        """Stop serving, also with browsers connected."""
        self._server.should_exit = True
        self._thread.join(END_S)
        self._socket.close()


def _nothing_here(_request: Request, _error: Exception) -> PlainTextResponse:
    """NiceGUI would build a page for it and keep that in memory, and log a line."""
    return PlainTextResponse("there is no such page\n", 404)


def _bound(address: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0][0]
        server = socket.socket(family, socket.SOCK_STREAM)
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind((address, port))
        # From now on connections wait, instead of being refused, until the thread serves them.
        server.listen()
    except OSError as error:
        raise ConfigurationError(
            f"address = {address!r}, port = {port}: cannot be used ({error.strerror}): choose "
            "another port, or end the program that uses it"
        ) from None
    return server
