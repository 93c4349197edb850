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

"""Access control of the page: local requests, or requests with the token; HTTP and WebSocket.

Host and Origin of every request are checked as well, against requests that other sites make the
browser send, and against foreign domain names that resolve to this machine (DNS rebinding).
"""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

from flea_diag.errors import ConfigurationError
from flea_diag.web.socket_gate import POLICY_VIOLATION, bounded
from flea_diag.web.throttle import Throttle
from flea_diag.wire.regular_file import read_text

Scope = MutableMapping[str, Any]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Any, Send], Awaitable[None]]

COOKIE = "flea_token"
SHORTEST_TOKEN, LEAST_CHARACTERS = 16, 6
"""Of a token, and how many different ones: the right one passes at any time, so none may be guessed
within a few thousand attempts."""
LARGEST_TOKEN_BYTES = 4096
LOCAL_NAMES = ("localhost",)
SOCKET_PATH = "/_nicegui_ws/"
STAND_PATH = "/stand/"
"""Before the name of a stand, in the address of its page where there are several."""
MOST_GUESSES, GUESSES_S = 10, 60.0
"""Limit of wrong tokens from one address, and its period."""
MOST_LOADS, LOADS_S = 30, 10.0
"""So often the page may be loaded from one address: each load takes a quarter of a megabyte for
as long as a browser may still connect."""

CONTENT_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self' data:; "
    "connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'"
)
"""Only own content. 'unsafe-eval' is needed since Vue compiles templates in the browser."""

HEADERS = (
    (b"content-security-policy", CONTENT_POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
)

ASK = """<!doctype html><meta charset="utf-8"><title>flea_diag: token</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<body style="font: 17px system-ui; max-width: 28em; margin: 12vh auto; padding: 0 1em">
<h1 style="font-size: 24px">Access token required</h1>
<p>The token is in the file named by the parameter <code>token_file</code> of the node.</p>
<form><label>Token <input name="token" type="password" autocomplete="off" autofocus></label>
<button>Open</button></form>"""


def is_loopback(address: str) -> bool:
    """Whether only this machine can reach an address."""
    if address in LOCAL_NAMES:
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def token_of(address: str, token_file: str) -> str:
    """The required token; empty where none is needed.

    Raises
    ------
    ConfigurationError
        The address is open to the network without a token, or the file holds no token.
    """
    if not token_file:
        if is_loopback(address):
            return ""
        raise ConfigurationError(
            f"address = {address!r} opens the page to the network: name a file with a token of at "
            f"least {SHORTEST_TOKEN} characters (-p token_file:=FILE), or use 127.0.0.1"
        )
    try:
        token = read_text(Path(token_file), LARGEST_TOKEN_BYTES, ConfigurationError).strip()
    except OSError as error:
        raise ConfigurationError(f"token_file = {token_file!r} cannot be read: {error}") from None
    if len(token) < SHORTEST_TOKEN:
        raise ConfigurationError(
            f"token_file = {token_file!r} holds {len(token)} characters, a token has at least "
            f"{SHORTEST_TOKEN}: create one with openssl rand -hex 16 >FILE"
        )
    if len(set(token)) < LEAST_CHARACTERS:
        raise ConfigurationError(
            f"token_file = {token_file!r} holds {len(set(token))} different characters, a token "
            f"has at least {LEAST_CHARACTERS}: create one with openssl rand -hex 16 >FILE"
        )
    return token


class Guard:
    """ASGI application around another one: admits, asks for the token, or refuses.

    Parameters
    ----------
    app
        Application to protect.
    token
        Required token; empty for none.
    local_only
        Whether the server listens on the loopback alone; then only loopback names are valid hosts.
    """

    def __init__(self, app: App, token: str = "", local_only: bool = True) -> None:
        self._app, self._token, self._local_only = app, token.encode(), local_only
        self._guesses = Throttle(MOST_GUESSES, GUESSES_S)
        self._loads = Throttle(MOST_LOADS, LOADS_S)

    async def __call__(self, scope: Scope, receive: Any, send: Send) -> None:
        """Handle one connection."""
        if scope["type"] not in ("http", "websocket"):
            return await self._app(scope, receive, send)
        headers = {
            key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]
        }
        try:
            served = self._right_host(headers) and _same_origin(headers)
        except ValueError:  # an address in brackets that do not close
            return await _refuse(scope, send, 400, b"the Host or Origin is malformed\n")
        if not served or not _asked_for_by_a_person(scope, headers):
            return await _refuse(scope, send, 403, b"this host or origin is not served\n")
        who = (scope.get("client") or ("",))[0]
        if _is_polling(scope):
            return await _refuse(scope, send, 400, b"the page is served over WebSocket alone\n")
        receive = bounded(receive) if scope["type"] == "websocket" else receive
        kept = _cookie(headers.get("cookie", ""))
        if not self._token or self._is_token(kept):
            if _is_page(scope) and not self._loads.passes(who):
                return await _refuse(scope, send, 429, b"the page was loaded too often just now\n")
            return await self._app(scope, receive, _with_headers(send))
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[-1]
        # Behind a proxy all come from one address: others' wrong tokens lock out no right one.
        if scope["type"] == "http" and self._is_token(given):
            return await _welcome(scope, send, given)
        if (given or kept) and not self._guesses.passes(who):
            return await _refuse(scope, send, 429, b"too many tokens were tried just now\n")
        return await _refuse(scope, send, 401, ASK.encode(), b"text/html; charset=utf-8")

    def _right_host(self, headers: dict[str, str]) -> bool:
        name = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        return is_loopback(name) or not self._local_only

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token)


def _cookie(cookies: str) -> str:
    """The token that a browser keeps, "" for none."""
    try:
        jar = SimpleCookie(cookies)
    except CookieError:
        return ""
    return jar[COOKIE].value if COOKIE in jar else ""


def _is_page(scope: Scope) -> bool:
    """Whether this makes a page, which the server keeps until its browser has gone."""
    asked = scope["type"] == "http" and scope.get("method") == "GET"
    return asked and (scope["path"] == "/" or scope["path"].startswith(STAND_PATH))


def _is_polling(scope: Scope) -> bool:
    """Whether this is the other way to send what a WebSocket carries, with other limits."""
    return scope["type"] == "http" and scope["path"].startswith(SOCKET_PATH)


def _asked_for_by_a_person(scope: Scope, headers: dict[str, str]) -> bool:
    """Not by another page, as the address of a picture: browsers say what they want it for."""
    return not _is_page(scope) or headers.get("sec-fetch-dest", "document") == "document"


def _same_origin(headers: dict[str, str]) -> bool:
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc == headers.get("host")


def _with_headers(send: Send) -> Send:
    async def sent(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *HEADERS]
        await send(message)

    return sent


async def _refuse(
    scope: Scope, send: Send, status: int, body: bytes, kind: bytes = b"text/plain"
) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        return
    await _answer(send, status, [(b"content-type", kind), (b"cache-control", b"no-store")], body)


async def _welcome(scope: Scope, send: Send, token: str) -> None:
    """Store the token in a cookie that scripts cannot read, and remove it from the URL."""
    cookie = f"{COOKIE}={quote(token)}; Path=/; HttpOnly; SameSite=Strict"
    # One slash: after two a browser takes what follows for another host.
    path = "/" + quote(scope["path"].lstrip("/\\"))
    headers = [(b"location", path.encode()), (b"set-cookie", cookie.encode())]
    await _answer(send, 303, headers, b"")


async def _answer(send: Send, status: int, headers: list[tuple[bytes, bytes]], body: bytes) -> None:
    start = {"type": "http.response.start", "status": status, "headers": [*headers, *HEADERS]}
    await send(start)
    await send({"type": "http.response.body", "body": body})
