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

"""Events as rcl_interfaces/Log, which log panels of viewers list and mark on their timeline."""

from __future__ import annotations

from flea_diag.wire.messages.cdr import CdrWriter
from flea_diag.wire.records import Level

LOG = "rcl_interfaces/msg/Log"

_SEVERITY: dict[Level, int] = {Level.OK: 20, Level.WARN: 30, Level.ERROR: 40, Level.STALE: 30}
"""Level -> INFO, WARN and ERROR of rcl_interfaces/Log."""


def encode_log(stamp_ns: int, level: Level, name: str, text: str) -> bytes:
    """CDR bytes of one event; ``name`` is its source, as the node of a log line.

    Raises
    ------
    WireError
        The stamp or a text cannot be represented.
    """
    writer = CdrWriter(stamp_ns, frame=False)
    writer.u8(_SEVERITY[level])
    for part in (name, text, "", ""):  # file and function of a line of source code
        writer.text(part)
    writer.u32(0)
    return bytes(writer)
