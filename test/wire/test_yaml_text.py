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

"""YAML that is none is refused in one line, however the parser fails on it."""

from __future__ import annotations

import ast
import math
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from support.bombs.parsed import refusal
from support.places import ROOT

from flea_diag.configuration import calibrations, knowledge, screens
from flea_diag.configuration.files import load_yaml
from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.tools.campaign.campaign import load_campaign
from flea_diag.wire import yaml_text
from flea_diag.wire.bags.bag_description import BagDescription, described, description
from flea_diag.wire.bags.bag_reader import BagReader
from flea_diag.wire.yaml_text import parse_yaml
from flea_sim_driver.scenario.scenario_file import load_scenario

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
    assert described(tmp_path, losses) is None
    assert len(losses) == 1
    assert re.match(r"metadata\.yaml is unreadable: [^\n]+$", losses[0])


def test_plain_values_are_read() -> None:
    assert parse_yaml("a: [1, 2.5, x]") == {"a": [1, 2.5, "x"]}


# --- bombs: well-formed, small, and enormous once they are written out -------------------------


def layers(count: int, first: str, line: str) -> str:
    """Anchors a0 to a<count>, each made of the one before it."""
    rows = [line.replace("@", f"*a{n - 1}") for n in range(1, count + 1)]
    return "\n".join([f"a0: &a0 {first}", *(f"a{n}: &a{n} {row}" for n, row in enumerate(rows, 1))])


PAIRS = "{" + ", ".join(f"k{n}: 1" for n in range(10)) + "}"
TENFOLD = "[" + ", ".join(["@"] * 10) + "]"
MERGES = layers(9, PAIRS, "{<<: " + TENFOLD + "}")
BOMBS = {
    "merge keys": (MERGES, "more than 100000 values"),
    "merge key of one mapping, over and over": (layers(60, "{k: 1}", "{<<: [@, @]}"), "more than"),
    "merge keys in the midst": (layers(30, PAIRS, "{a: 1, <<: [@, @], b: 2}"), "more than"),
    "lists of aliases": (layers(60, "[x]", TENFOLD), "more than 100000 values"),
    "mappings of aliases": (layers(60, "{k: 1}", "{a: @, b: @, c: @}"), "more than"),
    "aliases as keys": (layers(60, "[x]", "{? @ : @}"), "more than 100000 values"),
    "sets of aliases": (layers(40, "{k: 1}", "!!set {? @, ? [@]}"), "more than 100000 values"),
    "ordered mappings": (layers(40, "{k: 1}", "!!omap [a: @, b: @]"), "more than 100000 values"),
    "one long list, often": (f"a: &a [{'x, ' * 999}x]\nb: [{'*a, ' * 999}*a]", "more than"),
    "many aliases of nothing much": (f"[&a x{', *a' * 200_000}]", "more than 100000 values"),
    "itself": ("&a [*a]", "refers to what it stands in"),
    "itself as a merge": ("&a {<<: *a}", "refers to what it stands in"),
    "itself, further down": ("a: &a {b: [{c: *a}]}", "refers to what it stands in"),
    "deep lists": ("[" * 100_000, "nested deeper than 50 levels"),
    "deep mappings": ("{a: " * 100_000, "nested deeper than 50 levels"),
    "deep blocks": ("- " * 100_000, "nested deeper than 50 levels"),
    "deep keys": ("? " * 100_000, "nested deeper than 50 levels"),
    "deep by aliases": (layers(300, "[x]", "[@]"), "nested deeper than 50 levels"),
    "deep by merges": (layers(300, "{k: 1}", "{<<: @}"), "nested deeper than 50 levels"),
    "many values": (f"[{'1,' * 500_000}]", "more than 100000 values"),
    "many lists": (f"[{'[],' * 300_000}]", "more than 100000 values"),
    "many keys": ("".join(f"k{n}:\n" for n in range(110_000)), "more than 100000 values"),
    "digits": ("a: " + "9" * 500_000, "a number of 500000 characters, at most 100"),
    "hexadecimal digits": ("a: 0x" + "f" * 500_000, "a number of 500002 characters"),
    "binary digits": ("a: 0b" + "1" * 500_000, "a number of 500002 characters"),
    "base sixty": ("a: 1" + ":1" * 200_000, "a number of 400001 characters"),
    "underscores": ("a: 1" + "_1" * 200_000, "a number of 400001 characters"),
    "digits behind the point": ("a: 0." + "1" * 500_000, "a number of 500002 characters"),
    "digits by a tag": ("a: !!int '" + "9" * 500_000 + "'", "a number of 500000 characters"),
    "fractions of a second": ("a: 2001-01-01 00:00:00." + "1" * 500_000, "a number of"),
    "long": ("a: '" + "x" * (1 << 20) + "'", "1048581 characters, at most 1048576 are read"),
    "long key": ("x" * 500 + ": 1", "is not a key of at most 80 characters"),
    "alias of a long name": ("*" + "x" * 100_000, "found undefined alias"),
    "long tag": ("!" + "x" * 100_000 + " a", "could not determine a constructor"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_before_it_takes_memory_or_time(name: str) -> None:
    """In a process of its own, with 500 MB and 10 processor seconds at most."""
    text, words = BOMBS[name]
    said = refusal("yaml_text", "parse_yaml", text)
    assert words in said
    assert said.count("\n") == 1
    assert len(said) < 300


def test_the_merge_bomb_costs_milliseconds() -> None:
    """As small as the one that once took gigabytes."""
    assert len(MERGES) < 800
    before_s = time.process_time()
    with pytest.raises(ValueError, match="more than 100000 values"):
        parse_yaml(MERGES)
    assert time.process_time() - before_s < 1.0


def test_aliases_and_merges_within_the_limits_are_read() -> None:
    text = "a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: [*a, *a]\nd: {<<: [*a, {z: 4}]}"
    assert parse_yaml(text) == {
        "a": {"x": 1, "y": 2},
        "b": {"x": 1, "y": 3},
        "c": [{"x": 1, "y": 2}] * 2,
        "d": {"x": 1, "y": 2, "z": 4},
    }
    assert parse_yaml(layers(20, "[x]", "[@]"))["a20"]


SHOWN = {
    "escape in a date": ('a: !!timestamp "\\e[2J"', r"'\x1b[2J' is no timestamp"),
    "direction in a number": ('a: !!int "\u202e1"', r"'\u202e1' is no int"),
    "long text for a number": ("a: !!float " + "x" * 90, "is no float (line 1, column 4)"),
    "escape in a key": ('"\\e[31m": 1', r"'\x1b[31m' is not a key"),
    "direction in a key": ("a\u202eb: 1", r"'a\u202eb' is not a key"),
    "line in a key": ('"a\\nb": 1', r"'a\nb' is not a key"),
    "alias of another script": ("*\u202e", "(line 1, column"),
}


@pytest.mark.parametrize("name", SHOWN)
def test_an_error_shows_one_value_and_nothing_around_it(name: str) -> None:
    text, words = SHOWN[name]
    secret = "root:x:0:0"
    with pytest.raises(ValueError, match=r"^[^\n]+$") as caught:
        parse_yaml(f"{text}\nrest: {secret}")
    said = str(caught.value)
    assert words in said
    assert secret not in said
    assert said.isprintable()
    assert len(said) < 250


def by_python(text: str) -> object:
    """As ``parse_yaml`` without libyaml."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml_text, "LOADERS", yaml_text.LOADERS[-1:])
        return parse_yaml(text)


SLOW = ("many lists", "many values", "many keys", "many aliases of nothing much")
"""Of 100 000 values each, which take Python's parser seconds."""


@pytest.mark.parametrize("name", [name for name in (*BOMBS, *SHOWN, *BAD) if name not in SLOW])
def test_both_parsers_refuse_in_the_same_words(name: str) -> None:
    text = BAD[name] if name in BAD else {**BOMBS, **SHOWN}[name][0]
    said = []
    for parse in (parse_yaml, by_python):
        with pytest.raises(ValueError, match=r".") as caught:
            parse(text)
        said.append(str(caught.value))
    assert said[0] == said[1]


def test_both_parsers_read_the_same_of_every_file_that_is_shipped() -> None:
    assert len(yaml_text.LOADERS) == 2
    files = [*(ROOT / "config").rglob("*.yaml"), *(ROOT / "bags").rglob("metadata.yaml")]
    assert len(files) > 20
    for file in files:
        text = file.read_text()
        assert repr(parse_yaml(text)) == repr(by_python(text)) == repr(yaml.safe_load(text))


def test_what_libyaml_refuses_and_yaml_allows_is_read() -> None:
    assert parse_yaml("[a:, b]") == by_python("[a:, b]") == [{"a": None}, "b"]


def test_no_other_reader_of_yaml_is_left() -> None:
    """Whatever is read passes the limits: nobody else calls the parser."""
    gate = ROOT / "flea_diag" / "wire" / "yaml_text.py"
    parsers = {"load", "load_all", "safe_load", "safe_load_all", "full_load", "unsafe_load"}
    parsers |= {"compose", "compose_all", "parse", "scan", "SafeLoader", "Loader", "FullLoader"}
    found = [
        f"{path}: yaml.{node.attr}"
        for package in ("flea_diag", "flea_sim_driver")
        for path in (ROOT / package).rglob("*.py")
        if path != gate
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "yaml"
        and node.attr in parsers
    ]
    assert found == []


# --- metadata.yaml, field by field -------------------------------------------------------------


def metadata(**changes: object) -> dict[str, object]:
    row = {"topic_metadata": {"name": "/a"}, "message_count": 3}
    known = {
        "version": 9,
        "storage_identifier": "mcap",
        "relative_file_paths": ["a_0.mcap"],
        "topics_with_message_count": [row],
    }
    return {"rosbag2_bagfile_information": {**known, **changes}}


def counted(count: object) -> dict[str, object]:
    row = {"topic_metadata": {"name": "/a"}, "message_count": count}
    return metadata(topics_with_message_count=[row])


WRONG = {
    "paths a number": (metadata(relative_file_paths=5), "relative_file_paths = 5 must be a list"),
    "paths a text": (metadata(relative_file_paths="a.mcap"), "must be a list"),
    "a path a number": (
        metadata(relative_file_paths=[5]),
        "relative_file_paths[0] = 5 must be text",
    ),
    "a path a list": (metadata(relative_file_paths=[["a"]]), "= ['a'] must be text"),
    "count infinite": (counted(math.inf), "message_count = inf must be a whole number"),
    "count not a number": (counted(math.nan), "message_count = nan must be a whole number"),
    "count negative": (counted(-1), "message_count = -1 is below its limit 0"),
    "count a truth value": (counted(True), "message_count = True must be"),
    "count a text": (counted("3"), "message_count = '3' must be"),
    "count missing": (counted(None), "message_count = None must be"),
    "count beyond 64 bits": (counted(10**4000), "a whole number of some 4000 digits must be"),
    "version a text": (metadata(version="nine"), "version = 'nine' must be a whole number"),
    "version with an escape": (metadata(version="\x1b[2J"), r"version = '\x1b[2J' must be"),
    "storage a number": (metadata(storage_identifier=3), "storage_identifier = 3 must be text"),
    "topics a mapping": (metadata(topics_with_message_count={}), "must be a list"),
    "a topic a text": (metadata(topics_with_message_count=["/a"]), "= '/a' must be a mapping"),
    "information a list": ({"rosbag2_bagfile_information": []}, "= [] must be a mapping"),
    "nothing": (None, "None must be a mapping"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_field_of_the_metadata_is_named(name: str) -> None:
    content, words = WRONG[name]
    with pytest.raises(RecordingError) as caught:
        description(content)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 200


BAD_METADATA = {
    **{name: yaml.safe_dump(content) for name, (content, _) in WRONG.items()},
    "digits": "rosbag2_bagfile_information: {version: " + "9" * 500_000 + "}",
    "hexadecimal digits": "rosbag2_bagfile_information: {version: 0x" + "f" * 500_000 + "}",
    "bomb": MERGES + "\nrosbag2_bagfile_information: {relative_file_paths: *a9, version: *a9}",
}


@pytest.mark.parametrize("name", BAD_METADATA)
def test_a_bag_is_read_without_metadata_that_cannot_be(name: str, tmp_path: Path) -> None:
    bag = tmp_path / "jam"
    shutil.copytree(ROOT / "bags" / "jam", bag)
    (bag / "metadata.yaml").write_text(BAD_METADATA[name], encoding="utf-8")
    reader = BagReader(bag)
    assert "/sensors/slow" in reader.topics
    assert len(reader.losses) == 1
    assert re.match(r"metadata\.yaml is unreadable: [^\n]{1,250}$", reader.losses[0])


def test_sound_metadata_is_read() -> None:
    found = description(metadata())
    assert found == BagDescription(9, "mcap", ("a_0.mcap",), counts={"/a": 3})
    shipped = described(ROOT / "bags" / "jam", [])
    assert shipped is not None
    assert shipped.counts["/sensors/slow"] == 1600


# --- the commands -------------------------------------------------------------------------------

READERS: dict[str, Callable[[Path], object]] = {
    "calibration": calibrations.load_calibration,
    "actuator": lambda path: screens.load_causal_map(str(path)),
    "feature table": lambda path: knowledge.load_features(str(path)),
    "scenario": load_scenario,
    "campaign": load_campaign,
}
NAMED = {
    "merge bomb": MERGES + "\nschema_version: *a9",
    "alias bomb": layers(60, "[x]", TENFOLD) + "\nschema_version: *a60",
    "bomb as a name": layers(60, "[x]", TENFOLD) + "\nschema_version: 1\nname: *a60",
    "digits": "schema_version: 1" + "0" * 500_000,
    "digits of sixty": "schema_version: 1\nname: 1" + ":1" * 400_000,
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", NAMED)
def test_every_reader_of_files_refuses_bombs_in_one_line(
    reader: str, name: str, tmp_path: Path
) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(NAMED[name], encoding="utf-8")
    before_s = time.process_time()
    with pytest.raises(ConfigurationError, match=r"file\.yaml: not [^\n]{1,200}$"):
        READERS[reader](path)
    assert time.process_time() - before_s < 10.0
