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

"""The texts of the screens: one catalogue, complete in every language that is shipped."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.places import ROOT

from flea_diag.configuration.languages import catalogue, languages, places
from flea_diag.errors import ConfigurationError
from flea_diag.operator.words import language, speaking, tr

FOLDERS = ("flea_diag/operator", "flea_diag/web", "flea_diag/nodes/operator")
SAYING = {"tr", "later"}
OTHERS = languages()[1:]


def said() -> set[str]:
    """Every text that the code of the screens says, by the calls that say them."""
    folders = (ROOT / folder for folder in FOLDERS)
    paths = [path for folder in folders for path in folder.rglob("*.py")]
    paths.append(ROOT / "flea_diag" / "tools" / "replay" / "report.py")
    return {text for path in paths for text in _said(ast.parse(path.read_text("utf-8")))}


def _said(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            text = node.args[0] if node.args else None
            if node.func.id in SAYING and isinstance(text, ast.Constant):
                yield str(text.value)


@pytest.mark.parametrize("code", OTHERS)
def test_a_language_has_every_text_of_the_screens(code: str) -> None:
    texts = catalogue(code)[1]
    assert sorted(said() - set(texts)) == []


@pytest.mark.parametrize("code", OTHERS)
def test_a_language_has_no_text_that_nothing_says(code: str) -> None:
    """But those of the fault catalogues, which verdicts bring along."""
    catalogues = "".join(p.read_text("utf-8") for p in ROOT.glob("config/stands/*/faults.yaml"))
    left = set(catalogue(code)[1]) - said()
    assert [text for text in sorted(left) if not _brought(text, catalogues)] == []


def _brought(text: str, catalogues: str) -> bool:
    """Whether a catalogue says it; a part and where it sits are two entries of it."""
    part, _, where = text.partition(", ")
    return text in catalogues or (part in catalogues and bool(where) and where in catalogues)


def test_german_is_shipped() -> None:
    assert languages() == ("en", "de")


def test_a_text_keeps_its_places_and_what_no_file_has_stays_as_it_is() -> None:
    with speaking("de", {"{count} kept": "{count} behalten"}):
        assert (language(), tr("{count} kept", count=3)) == ("de", "3 behalten")
        assert tr("{count} lost", count=2) == "2 lost"
        assert tr("a {brace} of a record") == "a {brace} of a record"
    assert (language(), tr("{count} kept", count=3)) == ("en", "3 kept")


HEAD = "schema_version: 1\ncode: fr\ntexts:\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("schema_version: 1\ncode: fr\n", "a list of texts"),
        ("schema_version: 1\ncode: ../x\ntexts: []\n", "has a code"),
        (HEAD + "- {en: yes, fr: oui}\n", "is no text"),
        (HEAD + "- {en: limit}\n", "is no text"),
        (HEAD + "- {en: '{count} kept', fr: '{nombre} retenus'}\n", "the places in braces"),
        (HEAD + "- {en: '{count} kept', fr: '{count.__class__}'}\n", "the places in braces"),
        (HEAD + "- {en: 'limit', fr: 'limite {'}\n", "limite {"),
    ],
)
def test_a_file_that_is_none_is_refused_in_one_line(text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "fr.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"fr\.yaml|limite") as refused:
        catalogue(str(path))
    assert why in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_language_of_ones_own_is_a_file(tmp_path: Path) -> None:
    path = tmp_path / "fr.yaml"
    path.write_text(HEAD + "- {en: '{count} kept', fr: '{count} retenus'}\n", encoding="utf-8")
    assert catalogue(str(path)) == ("fr", {"{count} kept": "{count} retenus"})


def test_an_unknown_language_names_those_that_there_are() -> None:
    with pytest.raises(ConfigurationError, match=r"language = 'xx': .* en, de"):
        catalogue("xx")


def test_places_are_told_apart_by_name_and_form() -> None:
    assert places("{a:.2f} of {b}, {{no place}}") == {"a:.2f", "b:"}
