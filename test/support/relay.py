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

"""A relay node between a stand and the diagnoser's process, over DDS: it passes on what is left."""

from __future__ import annotations

from typing import Any

from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    Residual,
    Scan,
    VibrationBlock,
)
from support import lossy
from support.live import Peer, Process, node

BATCH = 20
"""Messages under way at once; far fewer than a reader's queue holds, so that DDS loses none."""
RESTARTS = ("set_back",)
"""After these a live diagnosis begins a new run, and counts from there."""
STILL_HELD = {"two_clocks": {"elsewhere": 1}}
"""What jumps back waits for what comes next, and after the last there is nothing."""
END_S = 10.0
"""For the last counters; what restarts the diagnosis never counts all."""
ECHO_S, PATIENT_S = 0.3, 5.0
"""For a residual of a batch, all of whose scans may be passed over; and while that is not so: on a
busy machine a reader that is not waited for has its queue overrun."""


def relayed(name: str, seed: int, domain: int) -> lossy.Passed:
    """One healthy run that is spoilt on its way to a diagnoser of its own."""
    spoilt = lossy.spoilt_run(name, seed)
    diagnoser = node("diagnoser", "-p", "memory:=none")
    with Process(diagnoser, domain), Peer(domain, name="relay") as relay:
        relay.bus.advertise(ChannelTable, VibrationBlock, Scan)
        relay.listen(AmbiguityGroup, DataQuality, Detection, Residual)
        for kind in (ChannelTable, VibrationBlock, Scan):
            assert relay.heard(kind)
        _pass_on(relay, spoilt.records)
        # The counters of the end are said once nothing has come for a while.
        sent = len(lossy.scans(spoilt.records))
        relay.bus.wait_until(lambda: _counted(relay) == sent, END_S)
    if name in RESTARTS:
        spoilt.expected = {}
    for counter, scans in STILL_HELD.get(name, {}).items():
        spoilt.expected[counter] -= scans
    return lossy.judged(name, seed, spoilt, relay.records)


def _counted(relay: Peer) -> int:
    """Scans that the diagnoser says it was sent."""
    said = [record for record in relay.records if isinstance(record, DataQuality)]
    return dict(lossy.stream(said).counters)["samples"] if said else 0


def _pass_on(relay: Peer, records: list[Any]) -> None:
    """As fast as they are taken."""
    limit_s = PATIENT_S
    for first in range(0, len(records), BATCH):
        batch = records[first : first + BATCH]
        for record in batch:
            relay.bus.publish(record)
        stamps = {record.stamp_ns for record in batch}
        came = relay.bus.wait_until(lambda of=stamps: _echoed(relay, of), limit_s)
        newest = {max(stamps)}
        relay.bus.wait_until(lambda of=newest: _echoed(relay, of), ECHO_S * came)
        limit_s = PATIENT_S if came else ECHO_S


def _echoed(relay: Peer, stamps: set[int]) -> bool:
    """Whether a residual of these scans is among what came last; stamps may jump."""
    last = relay.records[-10 * BATCH :]
    return any(isinstance(r, Residual) and r.stamp_ns in stamps for r in last)
