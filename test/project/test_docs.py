"""What the documents name is there: files, links, topics, nodes, commands."""

from __future__ import annotations

import re

import pytest
from support.places import ROOT

from flea_diag.tools.main import commands
from flea_diag.wire.records import Outcome
from flea_diag.wire.topics import TOPICS, Topic

DOCUMENTS = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")
FOLDERS = (ROOT, ROOT / "flea_diag")
SUFFIXES = (".py", ".md", ".yaml", ".toml", ".xml", ".sh", ".dot", ".svg", ".csv")
MADE_BY_USE = ("bags/runs", ".venv", "build/lib")
"""What a fresh checkout does not have."""

WORDS = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)#\s]+)\)")
COMMAND = re.compile(r"`flea ([a-z]+)")


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


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_relative_link_exists(document: str) -> None:
    links = [link for link in LINK.findall(text_of(document)) if "://" not in link]
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.parametrize("document", [*DOCUMENTS[1:], "LICENSE", "QUALITY_DECLARATION.md"])
def test_the_readme_links_it(document: str) -> None:
    assert document in LINK.findall(text_of("README.md"))


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_the_readme_has_a_row_for_each_topic(topic: Topic) -> None:
    assert row_of(topic) in text_of("README.md").splitlines()


@pytest.mark.parametrize("outcome", Outcome, ids=lambda outcome: outcome.value)
def test_the_readme_says_what_to_do_at_each_outcome(outcome: Outcome) -> None:
    assert f"\n| `{outcome.value}` |" in text_of("README.md")


def test_the_readme_has_a_row_for_each_node() -> None:
    nodes = {path.name for path in (ROOT / "launcher").iterdir() if not path.suffix}
    assert {node for node in nodes if f"\n| `{node}` |" not in text_of("README.md")} == set()


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_command_named_exists(document: str) -> None:
    assert set(COMMAND.findall(text_of(document))) <= set(commands())


def test_the_readme_names_every_command() -> None:
    text = text_of("README.md")
    assert [name for name in commands() if f"flea {name}" not in text] == []
