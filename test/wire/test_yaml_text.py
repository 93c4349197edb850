"""YAML that is none is refused in one line, however the parser fails on it."""

from __future__ import annotations

from pathlib import Path

import pytest

from flea_diag.configuration import load_yaml
from flea_diag.errors import ConfigurationError
from flea_diag.wire.bags.bag_reader import described
from flea_diag.wire.yaml_text import parse_yaml

BAD = {
    "date": "seed: 2020-13-45",
    "number": "seed: 0x_",
    "empty number": '!!int ""',
    "truth value": "!!bool maybe",
    "time": "!!timestamp x",
    "object": "!!python/object/apply:os.getcwd []",
    "open": "a: [",
    "deep": "[" * 5000,
}


@pytest.mark.parametrize("name", BAD)
def test_all_that_is_wrong_is_one_error_in_one_line(name: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]+$") as caught:
        parse_yaml(BAD[name])
    assert type(caught.value) is ValueError


@pytest.mark.parametrize("name", BAD)
def test_files_that_say_so_are_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / "metadata.yaml"
    path.write_text(BAD[name], encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"metadata\.yaml: not a YAML file"):
        load_yaml(path)
    losses: list[str] = []
    assert described(tmp_path, losses) == {}
    assert losses == ["metadata.yaml is unreadable (ValueError)"]


def test_plain_values_are_read() -> None:
    assert parse_yaml("a: [1, 2.5, x]") == {"a": [1, 2.5, "x"]}
