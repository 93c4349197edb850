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

"""Numbers on a command line, at their limits and beyond."""

from __future__ import annotations

from argparse import ArgumentTypeError

import pytest

from flea_diag.tools.argument import MOST, count, positive, share


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [(count, "1", 1), (count, str(MOST), MOST), (positive, "1e-9", 1e-9), (share, "0.999", 0.999)],
)
def test_what_is_within_its_limits_is_taken(kind, text, value) -> None:
    assert kind(text) == value


@pytest.mark.parametrize(
    ("kind", "texts"),
    [
        (count, ("0", "-1", "1.5", "one", "", str(MOST + 1), "²")),
        (positive, ("0", "-1", "nan", "inf", "far")),
        (share, ("0", "1", "-0.5", "nan", "half")),
    ],
)
def test_all_else_is_refused_with_the_limit(kind, texts) -> None:
    for text in texts:
        with pytest.raises(ArgumentTypeError, match=r"must (be|lie)"):
            kind(text)
