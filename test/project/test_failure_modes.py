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

"""The page of failure modes holds the table that the simulator has."""

from __future__ import annotations

from support.places import script


def test_the_page_is_what_the_failure_modes_give() -> None:
    hook = script("docs/hooks/failure_modes.py")
    page = hook.PAGE.read_text(encoding="utf-8")
    assert hook.renewed(page) == page, "renew it: python docs/hooks/failure_modes.py"
    assert page.count("\n| Controller") == 5
    assert hook.renewed(page.replace("jam", "jan")) != page
