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

"""A relay between the stand and the diagnoser, each a process of its own."""

from __future__ import annotations

import pytest
from support import relay


@pytest.mark.in_turn(2)
def test_a_relay_node_between_stand_and_diagnoser(domain: int) -> None:
    """Losses, delays and duplicates over DDS, to a process of its own."""
    run = relay.relayed("everything", 7, domain)
    assert (run.called, run.miscounted) == ((), ())
