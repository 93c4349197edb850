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

"""What the documents name is there: files, links, topics, outcomes, faults, nodes, commands."""

from __future__ import annotations

import html
import re
from itertools import pairwise

import pytest
from support.places import ROOT

from flea_diag.configuration.files import load_yaml
from flea_diag.tools.main import commands
from flea_diag.wire.records import Outcome
from flea_diag.wire.topics import TOPICS, Topic

IN_ROOT = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")
FRAGMENTS = ("docs/results/summary.md",)
"""Parts of pages, which stand in no navigation."""
PAGES = tuple(
    name
    for name in sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))
    if name not in FRAGMENTS
)
DOCUMENTS = (*IN_ROOT, *PAGES)
README_LINES = 200
FOLDERS = (ROOT, ROOT / "flea_diag")
SUFFIXES = (".py", ".md", ".yaml", ".toml", ".xml", ".sh", ".dot", ".svg", ".csv")
MADE_BY_USE = ("bags/runs", ".venv", "build/lib", "site/")
"""What a fresh checkout does not have."""
MADE_BY_BUILD = "reference/"
"""Pages that the site makes of the program: its strict build holds the links to them."""

WORDS = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)")
COMMAND = re.compile(r"`flea ([a-z][a-z-]*)")


def text_of(document: str) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def paths(text: str) -> list[str]:
    """Words in backticks that are paths: of a known ending, or below a folder of ours."""
    first = [name.split()[0].rstrip("/") for name in WORDS.findall(text) if name.strip()]
    return [
        name
        for name in first
        if not name.startswith("/")
        and not name.startswith(MADE_BY_USE)
        and name not in {topic.name for topic in TOPICS}
        and (name.endswith(SUFFIXES) or ("/" in name and (ROOT / name.split("/")[0]).is_dir()))
    ]


def row_of(topic: Topic) -> str:
    latched = ", latched" if topic.latched else ""
    message = topic.message.replace("/msg/", "/")
    return f"| {topic.record.__name__} | `{topic.name}` | {message} | {topic.depth}{latched} |"


def exists(name: str) -> bool:
    return any((folder / name).exists() for folder in FOLDERS)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_path_in_backticks_exists(document: str) -> None:
    assert [name for name in paths(text_of(document)) if not exists(name)] == []


def test_paths_are_told_from_other_words() -> None:
    text = "`core/a.py`, `scripts/run --help`, `sensors/slow`, `test/no`, `bags/runs/`, `x/y`"
    assert paths(text) == ["core/a.py", "scripts/run", "test/no"]
    assert [name for name in paths(text) if not exists(name)] == ["core/a.py", "test/no"]


def broken(document: str, text: str) -> list[str]:
    """Relative links and pictures of a document that lead nowhere."""
    folder = (ROOT / document).parent
    links = [link for link in LINK.findall(text) if "://" not in link]
    links = [link for link in links if not link.startswith(MADE_BY_BUILD)]
    return [link for link in links if not (folder / link).exists()]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_relative_link_exists(document: str) -> None:
    assert broken(document, text_of(document)) == []


def test_links_are_taken_from_where_they_stand() -> None:
    text = "[a](docs/method.md) [b](method.md#x) ![c](flow.svg) [d](https://example.org/e)"
    assert broken("README.md", text) == ["method.md", "flow.svg"]
    assert broken("docs/index.md", text) == ["docs/method.md"]


@pytest.mark.parametrize(
    "document",
    [
        *IN_ROOT[1:],
        "LICENSE",
        "QUALITY_DECLARATION.md",
        *(p for p in PAGES if p != "docs/index.md"),
    ],
)
def test_the_readme_links_it(document: str) -> None:
    assert document in LINK.findall(text_of("README.md"))


def test_the_readme_is_short() -> None:
    assert len(text_of("README.md").splitlines()) <= README_LINES


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_the_messages_have_a_row_for_each_topic(topic: Topic) -> None:
    assert row_of(topic) in text_of("docs/messages.md").splitlines()


@pytest.mark.parametrize("outcome", Outcome, ids=lambda outcome: outcome.value)
def test_each_outcome_is_explained_with_what_to_do(outcome: Outcome) -> None:
    assert f"\n| `{outcome.value}` |" in text_of("docs/outcomes.md")
    assert f"\n| `{outcome.value}` |" in text_of("README.md")


def test_each_fault_of_the_catalogue_is_named() -> None:
    sensors = tuple(f"{name}_" for name in load_yaml("actuator.yaml")["sensors"])
    faults = [name for name in load_yaml("faults.yaml")["faults"] if not name.startswith(sensors)]
    text = text_of("docs/outcomes.md")
    assert faults
    assert [fault for fault in faults if f"`{fault}`" not in text] == []


def nodes() -> set[str]:
    return {path.name for path in (ROOT / "launcher").iterdir() if not path.suffix}


def test_there_is_a_row_for_each_node() -> None:
    text = text_of("docs/ros.md")
    assert {node for node in nodes() if f"\n| `{node}` |" not in text} == set()


def test_the_readme_names_every_node() -> None:
    assert {node for node in nodes() if f"`{node}`" not in text_of("README.md")} == set()


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_command_named_exists(document: str) -> None:
    assert set(COMMAND.findall(text_of(document))) <= set(commands())


def test_every_command_has_a_row() -> None:
    rows = [line for line in text_of("docs/your_stand.md").splitlines() if line.startswith("| `")]
    first = " ".join(row.split("|")[1] for row in rows)
    assert [name for name in commands() if f"`flea {name}" not in first] == []


def test_every_script_is_named() -> None:
    scripts = [path for path in (ROOT / "scripts").iterdir() if not path.suffix]
    text = "".join(map(text_of, DOCUMENTS))
    assert [path.name for path in scripts if f"scripts/{path.name}" not in text] == []


def arrows_of(source: str) -> list[tuple[str, str]]:
    """Arrows of a DOT text, also those that are written one after the other."""
    chains = [line.partition("[")[0] for line in source.splitlines() if "->" in line]
    nodes = [re.findall(r"\w+", chain) for chain in chains]
    return sorted(pair for chain in nodes for pair in pairwise(chain))


@pytest.mark.parametrize("name", ["flow", "chain"])
def test_the_picture_is_drawn_from_its_source(name: str) -> None:
    """Each label and each arrow of the source is in the picture, and no other arrow."""
    source, drawn = text_of(f"docs/{name}.dot"), html.unescape(text_of(f"docs/{name}.svg"))
    labels = re.findall(r'label="([^"]*)"', re.sub(r"^//.*$", "", source, flags=re.MULTILINE))
    lines = [" ".join(line.split()) for label in labels for line in label.split("\\n")]
    spaced = re.sub(r"[ \u00a0]+", " ", drawn)
    assert [line for line in lines if line not in spaced] == []
    found = re.findall(r"<title>(\w+)->(\w+)</title>", drawn)
    assert sorted(found) == arrows_of(source)
    assert len(found) >= 8
