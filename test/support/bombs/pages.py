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

"""Requests and WebSocket messages that no browser sends, against the real server of the page."""

from __future__ import annotations

import contextlib
import json
import re
import socket
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from flea_diag.tools.terminal import say
from support.bombs.bomb import TOLD, Input, rows, several

LIMIT_S = 30.0
ANSWERS = "the page answers"
Talk = Callable[[int], object]


@cache
def tools() -> Any:
    """What every view needs of the stand."""
    from flea_diag.configuration.screens import load_causal_map, tree_planner
    from flea_diag.web.view import Tools

    return Tools(load_causal_map("actuator.yaml"), tree_planner("feature_table.yaml"))


def prepare() -> None:
    """Import the server, without a thread of it."""
    import websockets.sync.client  # noqa: F401

    import flea_diag.web.pages.site
    import flea_diag.web.server  # noqa: F401

    tools()


def _attacked(folder: Path, talk: Talk, token: str = "") -> Input:
    return Input(lambda: _serve(folder, talk, token), TOLD, (ANSWERS,))


def _serve(folder: Path, talk: Talk, token: str) -> int:
    """Serve the page of an empty desk, let somebody talk to it, and look whether it answers."""
    from flea_diag.nodes.operator.alarm_journal import AlarmJournal
    from flea_diag.nodes.operator.desk import Desk
    from flea_diag.web.pages.site import Site
    from flea_diag.web.server import Server

    desk = Desk(AlarmJournal(folder / "alarms.sqlite"), "Ada")
    Site(say).serve_stand(desk, tools(), "stand")
    server = Server("stand", "127.0.0.1", 0, token)
    server.start()
    try:
        with contextlib.suppress(OSError):
            talk(server.port)
        status = _asked(server.port, b"GET /other HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        say(ANSWERS if status.startswith(b"HTTP/1.1 4") else f"the page is silent: {status!r}")
    finally:
        server.close()
    return 0


def _asked(port: int, request: bytes) -> bytes:
    """The beginning of an answer, empty where the connection is closed."""
    connection = socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S)
    with connection, contextlib.suppress(OSError):
        connection.sendall(request)
        return connection.recv(4096)
    return b""


def _page_of(port: int) -> str:
    """The id of a page that was just loaded."""
    with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as connection:
        connection.sendall(
            b"GET / HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: close\r\n\r\n" % port
        )
        answer = b"".join(iter(lambda: connection.recv(65536), b"")).decode(errors="replace")
    found = re.search(r"client_id\W+([0-9a-f-]{36})", answer)
    return found[1] if found else "0"


def _told(port: int, *messages: str | bytes) -> None:
    """Send messages over a WebSocket of a page."""
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    page = _page_of(port)
    address = f"ws://127.0.0.1:{port}/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    address += f"&client_id={page}&tab_id=t&document_id=d&next_message_id=0"
    address += "&implicit_handshake=false"
    shake = {"client_id": page, "tab_id": "t", "document_id": "d", "next_message_id": 0}
    for message in messages:
        sent = message.replace("PAGE", page) if isinstance(message, str) else message
        with (
            contextlib.suppress(WebSocketException, OSError, TimeoutError),
            connect(address, max_size=None, open_timeout=LIMIT_S) as connection,
        ):
            connection.recv(LIMIT_S)
            connection.send("40")
            connection.send(f'420["handshake",{json.dumps(shake)}]')
            connection.send(sent)
            connection.recv(0.2)
            connection.recv(0.2)


def _headed(port: int, *lines: str, start: str = "GET / HTTP/1.1") -> bytes:
    return _asked(port, "\r\n".join([start, *lines, "", ""]).encode("latin-1", "replace"))


def malformed_hosts(folder: Path, chance: Random) -> Input:
    odd = ("[", "http://[", "[::1", "\x80", "a" * 10_000, "", "::::", "127.0.0.1:99999999", "//")
    hosts = [chance.choice(odd) for _ in range(10)]
    origins = [chance.choice(odd) for _ in range(10)]
    return _attacked(folder, lambda port: [
        _headed(port, f"Host: {host}", f"Origin: {origin}")
        for host, origin in zip(hosts, origins, strict=True)
    ])  # fmt: skip


def one_long_header(folder: Path, chance: Random) -> Input:
    size = several(10_000, 50_000_000, chance)
    return _attacked(folder, lambda port: _headed(port, "Host: 127.0.0.1", f"Cookie: {'x' * size}"))


def many_headers(folder: Path, chance: Random) -> Input:
    lines = [f"X-{k}: {k}" for k in range(several(100, 100_000, chance))]
    return _attacked(folder, lambda port: _headed(port, "Host: 127.0.0.1", *lines))


def odd_cookies(folder: Path, chance: Random) -> Input:
    odd = ('flea_token="', "flea_token=\x80", "=;=;=", "flea_token=" + "a" * 5000, "; " * 5000)
    cookie = chance.choice(odd)

    def talk(port: int) -> None:
        _headed(port, f"Host: 127.0.0.1:{port}", f"Cookie: {cookie}")

    return _attacked(folder, talk, token="0123456789abcdef")


def connections_of_nothing(folder: Path, chance: Random) -> Input:
    many, sent = several(10, 90, chance), chance.choice((b"", b"GET / HT", b"\r\n"))

    def talk(port: int) -> None:
        with contextlib.ExitStack() as opened:
            for _ in range(many):
                connection = socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S)
                opened.enter_context(connection).sendall(sent)

    return _attacked(folder, talk)


def loads_without_end(folder: Path, chance: Random) -> Input:
    many = several(31, 300, chance)
    return _attacked(
        folder,
        lambda port: [_headed(port, f"Host: 127.0.0.1:{port}") for _ in range(many)],
    )


def guesses_without_end(folder: Path, chance: Random) -> Input:
    many = several(11, 300, chance)

    def talk(port: int) -> None:
        for k in range(many):
            start = f"GET //x?token=guess{k} HTTP/1.1"
            _headed(port, f"Host: 127.0.0.1:{port}", start=start)

    return _attacked(folder, talk, token="0123456789abcdef")


def other_methods_and_paths(folder: Path, chance: Random) -> Input:
    methods = ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "X" * 1000)
    paths = ("/", "//evil/x", "/../../etc/passwd", "/%00", "/_nicegui_ws/socket.io/?EIO=4", "*")
    start = f"{chance.choice(methods)} {chance.choice(paths)} HTTP/1.1"
    length = f"Content-Length: {chance.choice((0, 10**18, -1))}"
    return _attacked(folder, lambda port: _headed(port, "Host: 127.0.0.1", length, start=start))


def large_messages(folder: Path, chance: Random) -> Input:
    size = several(70_000, 20_000_000, chance)
    sent: str | bytes = chance.choice(('42["event",{"x":"%s"}]' % ("x" * size), bytes(size)))
    return _attacked(folder, lambda port: _told(port, sent))


def deep_messages(folder: Path, chance: Random) -> Input:
    opening = chance.choice(("[", '{"a":'))
    depth = several(100, 10_000, chance)
    arg = json.dumps(opening * depth)
    event = f'{{"client_id":"PAGE","id":5,"listener_id":"x","args":[{arg}]}}'
    return _attacked(
        folder, lambda port: _told(port, "42" + opening * depth, f'42["event",{event}]')
    )


def messages_of_another_form(folder: Path, chance: Random) -> Input:
    """Events that NiceGUI knows, with values of every kind in every place."""
    odd = (None, True, -1, 2**70, 1e308, "", "x", "PAGE", [], {}, [[]], {"a": 1}, '"x"', ["[]"])
    events = ("handshake", "event", "javascript_response", "ack", "log", "disconnect", "x")
    keys = ("client_id", "id", "listener_id", "args", "tab_id", "document_id", "next_message_id",
            "request_id", "level", "message")  # fmt: skip
    messages = []
    for _ in range(4):
        data: dict[str, Any] = {"client_id": "PAGE", **{k: chance.choice(odd) for k in keys[1:]}}
        sound = {"id": 5, "listener_id": "x", "args": ["1"], "tab_id": "t", "next_message_id": 0}
        data.update({k: v for k, v in sound.items() if chance.random() < 0.6})
        messages.append(f"42{json.dumps([chance.choice(events), data])}")
    return _attacked(folder, lambda port: _told(port, *messages))


PAGES = rows(
    "page", malformed_hosts, one_long_header, many_headers, odd_cookies, connections_of_nothing,
    loads_without_end, guesses_without_end, other_methods_and_paths, large_messages, deep_messages,
    messages_of_another_form, prepare=prepare,
)  # fmt: skip
