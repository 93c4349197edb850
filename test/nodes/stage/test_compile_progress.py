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

"""How far the first start is, and how long it will still take."""

from __future__ import annotations

from support.live import Peer

from flea_diag.nodes.stage.compile_progress import ALL, CompileProgress
from flea_diag.wire.records import Health


def test_it_counts_and_foretells_at_the_same_pace(domain: int) -> None:
    now_s = 100.0
    with Peer(domain) as peer:
        progress = CompileProgress(peer.bus, lambda: now_s)
        words = []
        for count in range(1, ALL + 2):
            progress(f"loop_{count}")
            words.append(peer.bus.doing)
            now_s += 2.0
        assert Health in peer.bus.publishers
    assert words[0].startswith(f"compiling, 1 of {ALL} (loop_1)")
    assert words[2].startswith(f"compiling, 3 of {ALL}, about {2 * (ALL - 2)} s (loop_3)")
    assert words[-1].startswith(f"compiling, {ALL + 1} of {ALL + 1}, about 2 s")
