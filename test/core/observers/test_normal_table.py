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

from __future__ import annotations

import numpy as np

from flea_diag.core.observers.normal_table import RandomBits


def test_bits_taken_ahead_are_those_of_single_steps_wherever_they_end() -> None:
    """Asked for many, used in part: numbers and generator are as if drawn step by step."""
    one, many = np.random.default_rng(3), np.random.default_rng(3)
    singly, ahead = RandomBits(one, 7), RandomBits(many, 7)
    for asked, used in ((1, 1), (40, 16), (1000, 17), (1000, 300), (9, 2), (500, 40), (64, 64)):
        left = used
        while left:
            uniform, chosen = ahead.ahead(asked)
            taken = min(left, len(uniform))
            for k in range(taken):
                number, indices = singly.next()
                assert uniform[k] == number
                assert chosen[k].tolist() == indices.tolist()
            ahead.used(taken)
            left -= taken
        assert many.bit_generator.state == one.bit_generator.state
