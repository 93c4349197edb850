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

"""Messages whose layout is right and whose content is not; and names that are not seen."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import yaml

from flea_diag.errors import FleaError
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag_reader import BagReader
from flea_diag.wire.bags.bag_writer import BagWriter
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.topics import TOPIC_OF
from support.bombs.bomb import REFUSED, TOLD, Input, flea, rows, several
from support.places import CONFIG, ROOT

BAG = ROOT / "bags" / "winding_short"
HIDDEN = "\x1b[2J\x07\x08\r\x7f\x9b\u202e\u2066\u200b\u2028\U000e0041"
"""Characters that move a cursor, ring, turn a line around or are not seen."""


def _records(most: int = 400) -> list[Any]:
    return [record for _, (_, record) in zip(range(most), BagReader(BAG).records(), strict=False)]


def _read(folder: Path, chance: Random, records: list[Any], *says: str) -> Input:
    """A bag of these, whatever they say: written as bytes, past the writer's checks."""
    with BagWriter(folder / "bag") as bag:
        for number, record in enumerate(records):
            try:
                data = encode(record)
            except FleaError:
                continue  # such a message cannot even be written
            now_ns = 10**18 + number * 10**7
            bag.write_raw(f"/{TOPIC_OF[type(record)].name.lstrip('/')}", data, now_ns)
    bag = folder / "bag"
    commands = (("replay", bag), ("bag", "check", bag), ("recover", bag, "-o", folder / "out"))
    return Input(flea(*chance.choice(commands)), TOLD, says)


def _changed(folder: Path, chance: Random, kind: type, **changes: Any) -> Input:
    """A sound recording in which one in several messages of a kind is changed."""
    often = chance.choice((1, 2, 10))
    found = [
        replace(record, **changes) if type(record) is kind and number % often == 0 else record
        for number, record in enumerate(_records())
    ]
    return _read(folder, chance, found)


def stamps_of_another_time(folder: Path, chance: Random) -> Input:
    stamp_ns = chance.choice((-1, -(2**31) * 10**9, 0, (2**31 - 1) * 10**9, 1))
    return _changed(folder, chance, r.Scan, stamp_ns=stamp_ns)


def a_channel_twice(folder: Path, chance: Random) -> Input:
    names = ("motor_current", "motor_current", "load_force")
    return _changed(folder, chance, r.Scan, channels=names, values=(1.0, 2.0, 3.0))


def readings_that_are_no_number(folder: Path, chance: Random) -> Input:
    scan = next(record for record in _records() if isinstance(record, r.Scan))
    odd = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324)
    values = tuple(chance.choice(odd) for _ in scan.channels)
    return _changed(folder, chance, r.Scan, values=values)


def channels_without_end(folder: Path, chance: Random) -> Input:
    many = several(100, 20_000, chance)
    names = tuple(f"c{k}" for k in range(many))
    return _changed(folder, chance, r.Scan, channels=names, values=(1.0,) * many)


def names_without_end(folder: Path, chance: Random) -> Input:
    names = ("motor_current", "x" * several(1000, 1_000_000, chance))
    return _changed(folder, chance, r.Scan, channels=names, values=(1.0, 2.0))


def units_of_another_system(folder: Path, chance: Random) -> Input:
    unit = chance.choice(("furlong", "mA", "kN", "degF", "", "x" * 5000, HIDDEN))
    rate_hz = chance.choice((100.0, 0.0, -1.0, 1e300, float("nan")))
    row = r.ChannelInfo("motor_current", unit, -10.0, 10.0, rate_hz)
    table = next(record for record in _records() if isinstance(record, r.ChannelTable))
    return _changed(folder, chance, r.ChannelTable, channels=(row, *table.channels[1:]))


def ranges_that_are_none(folder: Path, chance: Random) -> Input:
    low, high = chance.choice(((1.0, -1.0), (float("nan"),) * 2, (-1e308, 1e308), (0.0, 0.0)))
    table = next(record for record in _records() if isinstance(record, r.ChannelTable))
    channels = tuple(replace(each, minimum=low, maximum=high) for each in table.channels)
    return _changed(folder, chance, r.ChannelTable, channels=channels)


def vibration_of_another_form(folder: Path, chance: Random) -> Input:
    many, axes = several(1, 60_000, chance), chance.choice((1, 2, 6))
    rate_ns = chance.choice((0, 1, 50_000, 2**31))
    offsets = np.minimum(np.arange(many) * rate_ns, 2**32 - 1)
    samples = np.full((many, axes), chance.choice((1.0, np.nan, 1e38)))
    names = tuple(f"accelerometer_1_{k}" for k in range(axes))
    blocks = [r.VibrationBlock.pack(10**18 + k, names, offsets, samples) for k in range(3)]
    return _read(folder, chance, [*blocks, *_records(100), *blocks])


def verdicts_of_others(folder: Path, chance: Random) -> Input:
    """A recorded verdict with more faults, more text and odder numbers than any of ours."""
    many = several(1, 5000, chance)
    odd = chance.choice((float("nan"), 2.0, -1.0, 1e308))
    members = tuple(r.Candidate(f"f{k}", "x", odd, "y" * 20) for k in range(many))
    group = r.AmbiguityGroup(
        10**18, r.Outcome.ISOLATED, 2**62, 2**62, 2**62, members, (), -(2**62), "w" * 5000, "",
        "live",
    )  # fmt: skip
    return _read(folder, chance, [*_records(200), group])


def of_every_stand(folder: Path, chance: Random) -> Input:
    """Scans that stand still, jump and come back: the clock of nobody."""
    scans = [record for record in _records() if isinstance(record, r.Scan)]
    chance.shuffle(scans)
    jumps = [replace(s, stamp_ns=s.stamp_ns + chance.choice((0, 10**18, 10**12))) for s in scans]
    return _read(folder, chance, [*jumps, *scans[:50], *scans[:50]])


MESSAGES = rows(
    "message", stamps_of_another_time, a_channel_twice, readings_that_are_no_number,
    channels_without_end, names_without_end, units_of_another_system, ranges_that_are_none,
    vibration_of_another_form, verdicts_of_others, of_every_stand,
)  # fmt: skip


# --- text that is not seen -----------------------------------------------------------------


def _hidden(chance: Random) -> str:
    return "jam" + "".join(chance.sample(HIDDEN, 5)) + "ok"


def a_hidden_channel(folder: Path, chance: Random) -> Input:
    names = ("motor_current", _hidden(chance))
    return _changed(folder, chance, r.Scan, channels=names, values=(1.0, 2.0))


def a_hidden_stand(folder: Path, chance: Random) -> Input:
    return _changed(folder, chance, r.ChannelTable, stand=_hidden(chance))


def a_hidden_truth(folder: Path, chance: Random) -> Input:
    truth = r.Truth(10**18, _hidden(chance), 10**18, ((_hidden(chance), _hidden(chance)),))
    return _read(folder, chance, [*_records(300), truth])


def a_hidden_verdict(folder: Path, chance: Random) -> Input:
    words = _hidden(chance)
    member = r.Candidate(words, words, 1.0, words)
    group = r.AmbiguityGroup(
        10**18, r.Outcome.ISOLATED, 1, 1, 1, (member,), (), 10**18, words, words, words
    )
    return _read(folder, chance, [*_records(300), group])


def a_hidden_run(folder: Path, chance: Random) -> Input:
    words = _hidden(chance)
    rows = [
        json.dumps({"schema_version": 1, "id": words, "kind": words, "row": words, "failure": why})
        for why in (words, "")
    ]
    for name, row in zip(("a.jsonl", "b.jsonl"), rows, strict=True):
        (folder / name).write_text(row + "\n")
    return Input(flea("diff", folder / "a.jsonl", folder / "b.jsonl"), TOLD)


def a_hidden_key(folder: Path, chance: Random) -> Input:
    path = folder / "s.yaml"
    path.write_text(yaml.safe_dump({_hidden(chance): 1, "motion": _hidden(chance)}))
    return Input(flea("simulate", path, "-o", folder / "out"), REFUSED)


def a_hidden_campaign(folder: Path, chance: Random) -> Input:
    tree = yaml.safe_load((CONFIG / "campaigns" / "small.yaml").read_text())
    tree["name"], tree["sources"][0]["name"] = _hidden(chance), _hidden(chance)
    tree["sources"][0]["kind"] = _hidden(chance)
    path = folder / "k.yaml"
    path.write_text(yaml.safe_dump(tree, allow_unicode=True))
    return Input(flea("evaluate", path, "-o", folder / "out", "-q"), REFUSED)


def a_hidden_file(folder: Path, chance: Random) -> Input:
    path = folder / _hidden(chance)
    path.write_bytes(b"\x89MCAP0\r\n")
    return Input(flea("bag", "check", path), TOLD)


def a_hidden_argument(folder: Path, chance: Random) -> Input:
    arguments = chance.choice((
        ("simulate", _hidden(chance)), ("diff", _hidden(chance), _hidden(chance)),
        ("replay", BAG, "--namespace", _hidden(chance)), ("replay", folder / _hidden(chance)),
        ("features", "study", "--seeds", _hidden(chance)),
    ))  # fmt: skip
    return Input(flea(*arguments), TOLD)


def a_hidden_column(folder: Path, chance: Random) -> Input:
    path = folder / "BatchProfile_sine12_2010_Nominal_Low.data"
    path.write_text("\t".join([_hidden(chance)] * 17) + "\n")
    return Input(flea("import", path, "-o", folder / "out"), TOLD)


HIDDEN_TEXTS = rows(
    "text", a_hidden_channel, a_hidden_stand, a_hidden_truth, a_hidden_verdict, a_hidden_run,
    a_hidden_key, a_hidden_campaign, a_hidden_file, a_hidden_argument, a_hidden_column,
)  # fmt: skip
