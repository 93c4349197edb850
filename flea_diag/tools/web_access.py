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

"""How files are fetched over HTTP: with time limits, few redirects, none into a local network."""

from __future__ import annotations

import ipaddress
import socket
from typing import Any
from urllib.parse import urljoin, urlsplit

from flea_diag.errors import RecordingError, shown

CONNECT_S, SILENT_S = 20.0, 60.0
"""Longest wait for a connection, and for more of an answer."""
MOST_REDIRECTS = 5


def web_options(url: str) -> dict[str, Any]:
    """What fsspec takes beside an address; nothing for other protocols than HTTP."""
    if not url.startswith(("http://", "https://")):
        return {}
    from aiohttp import ClientTimeout

    limits = ClientTimeout(total=None, sock_connect=CONNECT_S, sock_read=SILENT_S)
    return {
        "get_client": client,
        "client_kwargs": {"timeout": limits},
        "max_redirects": MOST_REDIRECTS,
    }


async def client(**known: Any) -> Any:
    """A session of aiohttp that looks at each redirect."""
    import aiohttp

    trace = aiohttp.TraceConfig()
    trace.on_request_redirect.append(_redirected)
    return aiohttp.ClientSession(**known, trace_configs=[trace])


async def _redirected(_session: Any, _context: Any, asked: Any) -> None:
    location = str(asked.response.headers.get("Location", ""))
    refuse_local(str(asked.url), urljoin(str(asked.url), location))


def refuse_local(origin: str, target: str) -> None:
    """Refuse a redirect from one host to another that is in a local network or this machine.

    Raises
    ------
    RecordingError
        It is; what a user types himself may be.
    """
    host = urlsplit(target).hostname or ""
    if host == urlsplit(origin).hostname:
        return
    try:
        found = {info[4][0] for info in socket.getaddrinfo(host, None)}
    except OSError:
        return  # the request says what is wrong with it
    if any(not ipaddress.ip_address(str(each).partition("%")[0]).is_global for each in found):
        raise RecordingError(
            f"redirected to {shown(host)}, which is no public address: name it yourself if it is "
            "meant"
        )


def last_part(url: str) -> str:
    """Last part of the path of an address, as it is written."""
    path = url.partition("://")[2].partition("?")[0].partition("#")[0]
    return path.rstrip("/").rpartition("/")[2]


def without_credentials(url: str) -> str:
    """The address as it may be printed: without user, password, query and fragment."""
    scheme, mark, rest = url.partition("://")
    place, slash, path = rest.partition("/")
    kept = path.partition("?")[0].partition("#")[0]
    hidden = "***@" if "@" in place else ""
    more = "?***" if "?" in path else ""
    return f"{scheme}{mark}{hidden}{place.rpartition('@')[2]}{slash}{kept}{more}"
