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

"""Closes idle connections: a real browser sends its request at once."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S = 10.0
"""Time limit for a complete request, from the connection or the previous answer."""
MOST_CONNECTIONS = 100
"""Limit of simultaneous connections; a screen uses three."""


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP protocol, closed after ``REQUEST_S`` without a request."""

    request_s = REQUEST_S

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the timeout."""
        super().connection_made(transport)
        self._look_again()

    def _look_again(self) -> None:
        self._last = self.cycle
        self._look = self.loop.call_later(self.request_s, self._close_if_idle)

    def _close_if_idle(self) -> None:
        transport: Any = self.transport
        if transport.is_closing() or transport.get_protocol() is not self:
            return  # closed, or upgraded to a WebSocket
        answered = self.cycle is None or self.cycle.response_complete
        if answered and self.cycle is self._last:
            transport.abort()
        else:
            self._look_again()
