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

"""The page of numbers holds every number of core and stages that decides, each with its reason."""

from __future__ import annotations

import importlib.util
from types import ModuleType

import pytest
from support.places import ROOT

HOOK = ROOT / "docs" / "hooks" / "deciding_numbers.py"


@pytest.fixture(scope="module")
def hook() -> ModuleType:
    """The script that renews the page."""
    spec = importlib.util.spec_from_file_location("deciding_numbers", HOOK)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_what_the_sources_say(hook: ModuleType) -> None:
    page = hook.PAGE.read_text(encoding="utf-8")
    assert hook.renewed(page) == page, "renew it: python docs/hooks/deciding_numbers.py"


def test_every_number_has_a_reason(hook: ModuleType) -> None:
    bare = [row for row in hook.numbers() if len(row.why) <= len("assumption")]
    assert not bare, "say why in a docstring below it, or in a comment beside it"


def test_a_number_without_a_reason_is_found(hook: ModuleType) -> None:
    text = "PLAIN = 1\nTOLD = 3.0  # why\nBARE = 4.0\nROW = (0.5, 2.0)\n"
    found = hook.of_source("core", "module.py", text)
    assert [(row.name, row.value, row.why) for row in found] == [
        ("TOLD", "3.0", "why"),
        ("BARE", "4.0", ""),
        ("ROW", "(0.5, 2.0)", ""),
    ]
