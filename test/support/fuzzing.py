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

"""What others write, damaged on purpose: each reader takes it or refuses it by a FleaError."""

from __future__ import annotations

import copy
import random
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from flea_diag.configuration import component, files
from flea_diag.configuration.stand import load_stand, stand_from_mapping
from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.calibration import calibration_reader
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.faults.fault import catalogue
from flea_diag.errors import FleaError
from flea_diag.tools.campaign.campaign import campaign_from_mapping
from flea_diag.tools.recordings.flea_data import COLUMNS, read_flea_data
from flea_diag.tools.recordings.flea_run import FleaRun
from flea_diag.wire import parameters
from flea_diag.wire.bags.bag_reader import BagReader
from flea_diag.wire.bags.bag_writer import BagWriter
from flea_diag.wire.bags.scan_columns import scan_block
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import (
    FeatureRequest,
    FeatureValue,
    Health,
    Level,
    Record,
    VerdictNumbers,
    VibrationBlock,
    VibrationLevel,
)
from flea_diag.wire.topics import TOPIC_NAMED
from flea_sim_driver.scenario.scenario_file import load_scenario, scenario_from_mapping
from support.json_readers import json_readers
from support.places import ROOT
from support.stands import said_in_blocks

BAG = ROOT / "bags" / "winding_short"
ODD = (
    None, True, 0, -1, 1, 2**63, 10**400, 1e308, -1e-308, float("nan"), float("inf"), "", "x", "-",
    "1e9", "\x00", "a" * 5000, [], {}, [[]], {"": {}}, [None], {1: 2}, b"x", [1e999] * 3,
)  # fmt: skip
"""Values that no file is expected to hold where they are put."""


@dataclass(frozen=True)
class Target:
    """A reader, and whole input that it takes."""

    name: str
    read: Callable[[Any], object]
    seeds: tuple[Any, ...]


def damaged(whole: Any, chance: random.Random) -> Any:
    """Bytes with some of them changed, cut or moved; a tree with odd values in it."""
    if isinstance(whole, bytes):
        return _damaged_bytes(whole, chance)
    tree = copy.deepcopy(whole)
    for _ in range(chance.randint(1, 3)):
        tree = _damaged_tree(tree, chance)
    return tree


def _damaged_bytes(whole: bytes, chance: random.Random) -> bytes:
    content = bytearray(whole)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(content) + 1)
        kind = chance.randrange(5)
        if kind == 0:
            del content[at:]
        elif kind == 1:
            del content[at : at + chance.randint(1, 9)]
        elif kind == 2:
            content[at:at] = content[at : at + chance.randint(1, 64)]
        elif kind == 3:
            content[at : at + 4] = chance.choice((b"\xff" * 4, bytes(4), b"\x7f\xff\xff\xff"))
        else:
            content[at : at + 1] = bytes([chance.randrange(256)])
    return bytes(content)


def _damaged_tree(tree: Any, chance: random.Random) -> Any:
    places = list(_places(tree))
    if not places:
        return chance.choice(ODD)
    holder, key = chance.choice(places)
    kind = chance.randrange(4)
    if kind == 0:
        del holder[key]
    elif kind == 1 and isinstance(holder, dict):
        holder[chance.choice(("unheard_of", 7, None, True))] = holder.pop(key)
    elif kind == 2:
        other, there = chance.choice(places)
        holder[key] = copy.deepcopy(other[there])
    else:
        holder[key] = chance.choice(ODD)
    return tree


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every dictionary or list of a tree, with each of its keys."""
    keys = list(tree) if isinstance(tree, dict) else range(len(tree) if type(tree) is list else 0)
    for key in keys:
        yield tree, key
        yield from _places(tree[key])


def accepted(target: Target, content: Any) -> bool:
    """Whether it was read; False where it was refused. Any other error comes through."""
    try:
        target.read(content)
    except FleaError as error:
        refusal = str(error)
    else:
        return True
    assert "\n" not in refusal, f"more than one line: {refusal}"
    return False


def as_text(target: Target) -> Target:
    """The same reader of a tree, fed with YAML text."""

    def read(content: bytes) -> object:
        return target.read(_read_yaml(content))

    return Target(target.name, read, tuple(yaml.safe_dump(s).encode() for s in target.seeds))


CALIBRATION = "calibration_simulated_stand.yaml"
SCENARIO = "scenarios/winding_short.yaml"

# --- the readers ------------------------------------------------------------------------


@cache
def folder() -> Path:
    """Where files for the readers are put: in memory, where that can be."""
    shared = Path("/dev/shm")
    return Path(tempfile.mkdtemp(dir=shared if shared.is_dir() else None))


def _file(name: str, content: bytes) -> Path:
    path = folder() / name
    path.write_bytes(content)
    return path


def _read_data(content: bytes) -> object:
    data = read_flea_data(_file("BatchProfile_sine12_2010_Nominal_Low.data", content))
    return list(FleaRun.of(data).scans())


def _read_bag(content: bytes) -> object:
    return list(BagReader(_file("damaged.mcap", content)).records())


def _read_yaml(content: bytes) -> object:
    return files.load_yaml(_file("damaged.yaml", content))


def _read_scenario(content: bytes) -> object:
    return load_scenario(_file("damaged.yaml", content))


def _read_catalogue(content: Any) -> object:
    return catalogue(content, actuator(files.load_yaml("actuator.yaml")))


def _read_parameters(content: Any) -> object:
    if not isinstance(content, dict):
        return None
    return parameters.build(component.DIAGNOSER.parameters, content, "parameters")


def _data_text() -> bytes:
    rows = []
    for k in range(60):
        stamp = f"2010-09-03_09:52:{47 + k // 100}.{k % 100:02d}000_-0700"
        values = [f"{2.0 * (k % 2) if 'Motor X' in name else 0.1:.4f}" for name in COLUMNS]
        rows.append("\t".join([stamp, *values]))
    return ("\n".join(rows) + "\n").encode()


def _bag_bytes(records: list[Record]) -> bytes:
    bag = Path(tempfile.mkdtemp(dir=folder())) / "bag"
    writer = BagWriter(bag)
    for record in records:
        writer.write(record, record.stamp_ns)
    writer.close()
    return next(bag.glob("*.mcap")).read_bytes()


@cache
def targets() -> tuple[Target, ...]:
    """Every reader of what others write."""
    samples: dict[type, list[Record]] = {}
    for _, record in BagReader(BAG).records():
        samples.setdefault(type(record), []).append(record)
    for said in (*_said(), *_VIBRATION):
        samples.setdefault(type(said), []).append(said)
    found = [
        Target(f"codec {kind.__name__}", partial(decode, kind), tuple(map(encode, rows[-3:])))
        for kind, rows in samples.items()
    ]
    scans = [encode(r) for r in samples[TOPIC_NAMED["sensors/slow"].record][:3]]
    found.append(Target("scan columns", lambda data: scan_block([scans[0], data]), tuple(scans)))
    short = [r for rows in samples.values() for r in rows[:4]]
    found.append(Target("bag", _read_bag, (_bag_bytes(short),)))
    found.append(Target("importer", _read_data, (_data_text(),)))
    texts = {name: files.config_path(name) for name in (
        "actuator.yaml", "faults.yaml", "feature_table.yaml", CALIBRATION,
        SCENARIO, "campaigns/small.yaml", "stands/flea/stand.yaml",
    )}  # fmt: skip
    found.append(Target("yaml text", _read_yaml, tuple(p.read_bytes() for p in texts.values())))
    found.append(Target("scenario text", _read_scenario, (texts[SCENARIO].read_bytes(),)))
    trees = {name: yaml.safe_load(path.read_bytes()) for name, path in texts.items()}
    values = {d.name: d.default for d in parameters.descriptors(component.DIAGNOSER.parameters)}
    readers: dict[str, tuple[Callable[[Any], object], Any]] = {
        "stand": (
            lambda tree: stand_from_mapping(tree, folder()), trees["stands/flea/stand.yaml"],
        ),
        "actuator": (actuator, trees["actuator.yaml"]),
        "faults": (_read_catalogue, trees["faults.yaml"]),
        "feature table": (
            lambda tree: FaultFeatureTable.from_mapping(tree, "x"), trees["feature_table.yaml"],
        ),
        "calibration": (
            lambda tree: calibration_reader.from_mapping(tree, "x"), trees[CALIBRATION],
        ),
        "scenario": (
            lambda tree: scenario_from_mapping(tree, "x"), trees[SCENARIO],
        ),
        "campaign": (
            lambda tree: campaign_from_mapping(tree, "x"), trees["campaigns/small.yaml"],
        ),
        "parameters": (_read_parameters, values),
    }  # fmt: skip
    found += [Target(name, read, (tree,)) for name, (read, tree) in readers.items()]
    found += [Target(name, read, (text,)) for name, (read, text) in json_readers(_file).items()]
    return tuple(found)


def _said() -> list[Record]:
    """What the diagnoser itself says to the bag's records."""
    # Plain numpy: under Atheris numba would have to compile what is traced.
    pipeline = component.make_pipeline(
        load_stand(), state_observer="none", observer_backend="numpy"
    )
    return list(said_in_blocks(pipeline, (r for _, r in BagReader(BAG).records(pipeline.consumes))))


_VIBRATION: tuple[Record, ...] = (
    VibrationBlock.pack(10**18, ("x", "y"), np.arange(8) * 50_000, np.ones((8, 2))),
    VibrationLevel(10**18, ("x", "y"), (0.1, 0.2), (3.1, 2.9)),
    VerdictNumbers(10**18, ("outcome", "probability/jam"), (2.0, 0.9)),
    FeatureRequest(10**18, 1, 1, "accelerometer_2_crest", 10**18 - 10**9, 10**18),
    FeatureValue(10**18, 1, 1, "crest", 10**18 - 10**9, 10**18, 3.0, "1", "+", 2.0, 4.0, "", 0.1),
    Health(10**18, "observer", Level.OK, "running", (("cpu_percent", "3.0"),)),
)
