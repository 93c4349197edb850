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

"""YAML and JSON that is well formed and enormous once it is made, or holds what no field takes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random

import yaml

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.journal_file import JournalFile
from flea_diag.tools.terminal import say
from support.bombs.bomb import REFUSED, TOLD, Input, flea, rows, several
from support.fuzzing import damaged
from support.json_readers import json_readers
from support.places import CONFIG, ROOT

BAG = ROOT / "bags" / "winding_short"
BASES: dict[str, tuple[str, Callable[[Path], tuple[object, ...]]]] = {
    "s.yaml": ("scenarios/jam.yaml", lambda path: ("simulate", path, "-o", path.parent / "out")),
    "k.yaml": (
        "campaigns/small.yaml", lambda path: ("evaluate", path, "-o", path.parent / "out", "-q"),
    ),
    "c.yaml": (
        "stands/flea/calibration_simulated_stand.yaml",
        lambda path: ("replay", BAG, "--calibration", path),
    ),
    "t.yaml": ("stands/flea/feature_table.yaml", lambda path: ("features", "tree", path)),
    "a.yaml": (
        "stands/flea/actuator.yaml", lambda path: ("model", "signatures", "--actuator", path),
    ),
    "stand.yaml": (
        "stands/flea/stand.yaml", lambda path: ("model", "signatures", "--stand", path.parent),
    ),
}  # fmt: skip


def _yaml(folder: Path, chance: Random, text: str) -> Input:
    """A file of any kind that is read as YAML, or a bag's description."""
    name = chance.choice([*BASES, "metadata.yaml"])
    if name not in BASES:
        shutil.copytree(BAG, folder / "bag")
        (folder / "bag" / name).write_text(text)
        return Input(flea("bag", "check", folder / "bag"), TOLD, (name,))
    (folder / name).write_text(text)
    return Input(flea(*BASES[name][1](folder / name)), REFUSED, (name,))


def _layers(levels: int, first: str, line: str) -> str:
    made = [f"a0: &a0 {first}"]
    made += [f"a{n}: &a{n} {line.replace('@', f'*a{n - 1}')}" for n in range(1, levels + 1)]
    return "\n".join(made) + f"\nschema_version: *a{levels}"


def merges_of_merges(folder: Path, chance: Random) -> Input:
    again = ", ".join("@" * several(2, 20, chance))
    return _yaml(folder, chance, _layers(several(20, 200, chance), "{k: 1}", f"{{<<: [{again}]}}"))


def aliases_of_aliases(folder: Path, chance: Random) -> Input:
    again = ", ".join("@" * several(2, 20, chance))
    line = chance.choice((f"[{again}]", "{a: @, b: @}", "{? @ : @}", "!!omap [a: @, b: @]"))
    return _yaml(folder, chance, _layers(several(20, 200, chance), "[x]", line))


def depth(folder: Path, chance: Random) -> Input:
    opening = chance.choice(("[", "{a: ", "- ", "? "))
    return _yaml(folder, chance, opening * several(60, 200_000, chance))


def values_without_end(folder: Path, chance: Random) -> Input:
    one = chance.choice(("1,", "[],", "{},", "x,", "'',"))
    return _yaml(folder, chance, f"[{one * several(110_000, 300_000, chance)}]")


def digits_without_end(folder: Path, chance: Random) -> Input:
    first = chance.choice(("1", "0x", "0b1", "0.", "1e", "-", "1:"))
    digits = chance.choice(("0", "1", "9")) * several(200, 900_000, chance)
    text = f"schema_version: {first}{digits}"
    return _yaml(folder, chance, text if first != "-" else f"schema_version: !!int '-{digits}'")


def a_file_of_ten_megabytes(folder: Path, chance: Random) -> Input:
    return _yaml(folder, chance, "# " + "x" * several(2 << 20, 100 << 20, chance))


def a_key_twice(folder: Path, chance: Random) -> Input:
    name = chance.choice(list(BASES))
    text = (CONFIG / BASES[name][0]).read_text()
    (folder / name).write_text(f"{text}\nschema_version: 1\nschema_version: 1\n")
    return Input(flea(*BASES[name][1](folder / name)), REFUSED, ("twice",))


def tags_of_other_programs(folder: Path, chance: Random) -> Input:
    tags = ("!!python/object/apply:os.system ['true']", "!!binary x", "!x y", "!!timestamp 9999-99")
    return _yaml(folder, chance, f"a: {chance.choice(tags)}")


def names_as_long_as_the_file(folder: Path, chance: Random) -> Input:
    """What a message would quote in full if nobody shortened it."""
    name = chance.choice([each for each in BASES if each != "c.yaml"])
    tree = yaml.safe_load((CONFIG / BASES[name][0]).read_text())
    tree["name"] = "x" * several(100, 900_000, chance)
    tree["unheard_of"] = tree["name"]
    (folder / name).write_text(yaml.safe_dump(tree))
    return Input(flea(*BASES[name][1](folder / name)), TOLD)


def another_value_in_one_place(folder: Path, chance: Random) -> Input:
    """A whole file with odd values in it: refused, or read where it still is sound."""
    name = chance.choice([each for each in BASES if each not in ("s.yaml", "k.yaml")])
    tree = damaged(yaml.safe_load((CONFIG / BASES[name][0]).read_text()), chance)
    (folder / name).write_text(yaml.dump(tree, allow_unicode=chance.random() < 0.5))
    return Input(flea(*BASES[name][1](folder / name)), TOLD)


YAMLS = rows(
    "YAML", merges_of_merges, aliases_of_aliases, depth, values_without_end, digits_without_end,
    a_file_of_ten_megabytes, a_key_twice, tags_of_other_programs, names_as_long_as_the_file,
    another_value_in_one_place,
)  # fmt: skip


# --- JSON ---------------------------------------------------------------------------------


def _json(folder: Path, chance: Random, text: str, *says: str) -> Input:
    """A file that is read as JSON, or a row of the journal of alarms."""
    kind = chance.choice(("a.json", "results.jsonl", "alarms.sqlite"))
    path = folder / kind
    if kind == "alarms.sqlite":
        return Input(lambda: _journal(path, text), TOLD, ("cannot be read",))
    path.write_text(text.replace("\n", " ") + "\n" if kind == "results.jsonl" else text)
    return Input(flea("diff", path, path), REFUSED, says or (kind,))


def _journal(path: Path, text: str) -> int:
    AlarmJournal(path).close()
    told: list[str] = []
    journal = AlarmJournal(path, say=told.append)
    row = "INSERT INTO alarm (stand, source, detected_ns, record) VALUES ('stand', 'live', 1, ?)"
    JournalFile(path, told.append).rows(row, (text,))
    alarms = journal.alarms()
    journal.close()
    say("\n".join(told) or f"{len(alarms)} alarms")
    return 0


def deep_json(folder: Path, chance: Random) -> Input:
    opening = chance.choice(("[", '{"a":', '[{"schema_version":'))
    return _json(folder, chance, opening * several(60, 1_000_000, chance))


def json_values_without_end(folder: Path, chance: Random) -> Input:
    one = chance.choice(("[],", "{},", "0,", '"",', "null,"))
    return _json(folder, chance, f"[{one * several(200_000, 20_000_000, chance)}0]")


def json_digits_without_end(folder: Path, chance: Random) -> Input:
    return _json(folder, chance, f'{{"schema_version": {"9" * several(200, 5_000_000, chance)}}}')


def quotes_without_end(folder: Path, chance: Random) -> Input:
    one = chance.choice(('"', '\\"', "\\\\", '\\"\\\\'))
    return _json(folder, chance, '"' + one * several(1000, 10_000_000, chance))


def one_long_text(folder: Path, chance: Random) -> Input:
    return _json(folder, chance, f'{{"bag": "{"x" * several(100_000, 60_000_000, chance)}"}}')


def keys_without_end(folder: Path, chance: Random) -> Input:
    keys = ",".join(f'"k{k}":0' for k in range(several(10_000, 2_000_000, chance)))
    return _json(folder, chance, f"{{{keys}}}")


def a_json_key_twice(folder: Path, chance: Random) -> Input:
    return _json(folder, chance, '{"schema_version": 1, "bag": "a", "schema_version": 1}', "twice")


def numbers_that_are_none(folder: Path, chance: Random) -> Input:
    odd = chance.choice(("NaN", "Infinity", "-Infinity", "1e999", "-1e400"))
    content = f'{{"schema_version": 1, "id": "a", "kind": "real", "row": "x", "cpu_s": {odd}}}'
    return _json(folder, chance, content)


def a_text_for_a_list(folder: Path, chance: Random) -> Input:
    odd = chance.choice(('"x"', "5", "true", "null", "{}", "[[]]", "[1e300]", '["x", 5]'))
    content = (
        f'{{"schema_version": 1, "id": "a", "kind": "real", "row": "x", "group": {odd}, '
        f'"alarms_s": {odd}, "bag": {odd}, "episodes": {odd}, "digest": {odd}}}'
    )
    return _json(folder, chance, content)


def odd_values_in_whole_json(folder: Path, chance: Random) -> Input:
    """Every reader of JSON, through its function: refused or read."""
    folder.mkdir(exist_ok=True)

    def put(name: str, content: bytes) -> Path:
        (folder / name).write_bytes(content)
        return folder / name

    read, whole = chance.choice(list(json_readers(put).values()))
    content = json.dumps(damaged(json.loads(whole), chance), default=str)
    return Input(lambda: _through(read, content), TOLD)


def _through(read: Callable[[bytes], object], content: str) -> int:
    from flea_diag.errors import FleaError

    try:
        read(content.encode())
    except FleaError as error:
        say(f"flea: {error}")
        return 2
    say("read")
    return 0


JSONS = rows(
    "JSON", deep_json, json_values_without_end, json_digits_without_end, quotes_without_end,
    one_long_text, keys_without_end, a_json_key_twice, numbers_that_are_none, a_text_for_a_list,
    odd_values_in_whole_json,
)  # fmt: skip
