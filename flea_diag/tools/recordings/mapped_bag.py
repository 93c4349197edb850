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

"""Recordings in bags, by the topics that the mapping of a stand names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flea_diag.errors import RecordingError, WireError, shown
from flea_diag.tools.recordings.bag_clocks import received_topics
from flea_diag.tools.recordings.mapped_recording import MappedRecording, checked
from flea_diag.tools.recordings.second_publisher import second_publisher
from flea_diag.tools.recordings.senders import Senders, Signature
from flea_diag.tools.recordings.source_checks import check_rate
from flea_diag.wire.bags.foreign_bag import ForeignBag
from flea_diag.wire.records import Scan, VibrationBlock
from flea_diag.wire.sources.field_path import FieldPath
from flea_diag.wire.sources.mapping import SourceMapping
from flea_diag.wire.sources.message_terms import MessageTerms, stamp_of
from flea_diag.wire.sources.scan_grid import ScanGrid
from flea_diag.wire.sources.vibration_stream import VibrationStream

MOST_SCANS = 5_000_000
FEWEST_SCANS = 10
"""Scans of a piece of a bag that is a recording of its own."""


class _Read(NamedTuple):
    """Readings of one message."""

    topic: str
    stamp_ns: int
    log_ns: int
    sender: Signature | None
    values: list[tuple[int, float]]


def of_bag(path: Path, mapping: SourceMapping) -> Iterator[MappedRecording]:
    """Recordings of a bag: one, or as many as its clock was set back in between.

    Raises
    ------
    RecordingError
        It lacks what the mapping names, or what it holds contradicts the mapping.
    """
    wanted = mapping.topics
    if "" in wanted or not wanted:
        raise RecordingError(f"{path} is a bag, {mapping.where} names columns: name a table")
    bag = ForeignBag(path)
    for topic, kind in (*wanted.items(), *_vibrating(mapping).items()):
        _check_topic(path, topic, kind, bag.topics, mapping)
    read, senders, blocks = _read(path, bag, mapping)
    received, said = received_topics(
        {topic: [e.stamp_ns for e in read if e.topic == topic] for topic in wanted},
        {topic: [e.log_ns for e in read if e.topic == topic] for topic in wanted},
    )
    times = {topic: iter(stamps) for topic, stamps in received.items()}
    read = [
        each._replace(stamp_ns=next(times[each.topic])) if each.topic in times else each
        for each in read
    ]
    out = {topic: senders.left_out(topic) for topic in wanted}
    notes = [
        f"{path}: {words}" for words in (*said, *(n for t in wanted for n in senders.notes(t)))
    ]
    read = [each for each in read if each.sender not in out[each.topic]]
    read, said = _of_one_publisher(path, read, len(mapping.terms))
    notes += [f"{path}: {words}" for words in said]
    stamps: dict[str, list[int]] = {topic: [] for topic in wanted}
    grid, pieces = ScanGrid(mapping), [list[Scan]()]
    for each in read:
        stamps[each.topic].append(each.stamp_ns)
        streams = grid.streams
        made = list(grid.push(each.stamp_ns, each.values))
        pieces[-1] += made
        if grid.streams > streams > 0:
            pieces.append([])
    pieces[-1] += grid.finish()
    for row in mapping.channels:
        topic = row.terms[0].topic
        words = check_rate(f"{path}: {topic}", mapping, [row], np.array(stamps[topic]))
        notes += [words] if words else []
    for made in _cut(path, mapping, pieces, grid, (*bag.losses[:3], *notes)):
        first_ns, last_ns = made.made[0].stamp_ns, made.made[-1].stamp_ns
        own = (each for each in blocks if first_ns <= each.stamp_ns <= last_ns)
        yield replace(made, vibration=tuple(own))


def _of_one_publisher(path: Path, read: list[_Read], count: int) -> tuple[list[_Read], list[str]]:
    """Readings without those of a second publisher of the same names, and words on it."""
    notes = []
    for topic in dict.fromkeys(each.topic for each in read):
        ours = [each for each in read if each.topic == topic]
        values = np.full((len(ours), count), np.nan)
        for row, each in enumerate(ours):
            for term, value in each.values:
                values[row, term] = value
        values = values[:, np.isfinite(values).any(axis=0)]
        stamps_s = 1e-9 * (np.array([each.log_ns for each in ours]) - ours[0].log_ns)
        try:
            found = second_publisher(stamps_s, values)
        except RecordingError as error:
            raise RecordingError(f"{path}: {topic}: {error}") from None
        if found.any():
            out = {id(each) for each, is_other in zip(ours, found, strict=True) if is_other}
            read = [each for each in read if id(each) not in out]
            notes.append(
                f"{topic}: {len(out)} of {len(ours)} messages jump away and back in all fields, at "
                "a rate of their own: a second publisher, left out"
            )
    return read, notes


def _vibrating(mapping: SourceMapping) -> dict[str, str]:
    """Message type of the topic of the accelerometers, if they have one."""
    topic = mapping.vibration_topic
    return {topic: mapping.axes[0].message} if topic else {}


def _cut(
    path: Path,
    mapping: SourceMapping,
    pieces: list[list[Scan]],
    grid: ScanGrid,
    notes: tuple[str, ...],
) -> Iterator[MappedRecording]:
    name = path.name.removesuffix(path.suffix)
    kept = [piece for piece in pieces if len(piece) >= FEWEST_SCANS] or pieces[:1]
    if len(kept) > 1:
        notes = (*notes, f"{path}: its clock was set {len(kept) - 1} times: {len(kept)} recordings")
    for number, piece in enumerate(kept, 1):
        own = f"{name}_{number}" if len(kept) > 1 else name
        made = checked(str(path), own, mapping, piece, grid, notes if number == 1 else ())
        yield made if number == 1 else replace(made, warnings=())


def _read(
    path: Path, bag: ForeignBag, mapping: SourceMapping
) -> tuple[list[_Read], Senders, list[VibrationBlock]]:
    """Readings of all messages of the mapped topics, in order of receipt, and vibration."""
    terms, senders = MessageTerms(mapping), Senders()
    vibrating, blocks = _vibrating(mapping), list[VibrationBlock]()
    stream = VibrationStream(mapping.axes) if vibrating else None
    read: list[_Read] = []
    last: dict[str, object] = {}
    written = {topic.lstrip("/"): topic for topic in (*mapping.topics, *vibrating)}
    for plain, log_ns, content in bag.messages(written):
        topic = written[plain]
        try:
            if stream is not None and topic in vibrating:
                blocks += stream.push(stamp_of(content, log_ns), content)
            if topic not in mapping.topics:
                continue
            values = terms.read(topic, content)
        except WireError as error:
            raise RecordingError(
                f"{path}: {topic}: {error}; correct its field in {mapping.where}"
            ) from error
        last[topic] = content
        sender = senders.add(topic, content)
        if values:
            read.append(_Read(topic, stamp_of(content, log_ns), log_ns, sender, values))
        if len(read) > MOST_SCANS:
            raise RecordingError(f"{path}: more than {MOST_SCANS} messages; split the bag")
    _check_found(path, mapping, terms, last)
    blocks += stream.finish() if stream is not None else ()
    return read, senders, blocks


def _check_topic(
    path: Path, topic: str, kind: str, known: dict[str, str], mapping: SourceMapping
) -> None:
    named = [(t.topic, r.channel) for r in mapping.channels for t in r.terms]
    named += [(axis.topic, axis.channel) for axis in mapping.axes]
    channel = next(channel for where, channel in named if where == topic)
    name = topic.lstrip("/")
    if name not in known:
        has = ", ".join(f"{has} ({known[has]})" for has in sorted(known)[:20])
        raise RecordingError(
            f"{path} has no topic {topic}, the source of {channel} in {mapping.where}; it has "
            f"{has or 'none'}"
        )
    if known[name] != kind:
        raise RecordingError(
            f"{path}: {topic} is of type {shown(known[name])[1:-1]}, {mapping.where} says {kind}; "
            "correct the type there"
        )


def _check_found(
    path: Path, mapping: SourceMapping, terms: MessageTerms, last: dict[str, object]
) -> None:
    """Every place that the mapping names was there at least once."""
    for number, term in enumerate(mapping.terms):
        if number in terms.found or term.path is None:
            continue
        if term.topic not in last:
            raise RecordingError(f"{path}: {term.topic} has no messages; record it again")
        names = term.path.names_in(last[term.topic])
        if _is_empty(last[term.topic], term.path):
            raise RecordingError(
                f"{path}: {term.topic}: {term.path.steps[-1][0]} is empty in every message: leave "
                f"the channel out of {mapping.where}, or have it sent"
            )
        has = f"its elements are {', '.join(names[:20])}" if names else "it has too few elements"
        raise RecordingError(
            f"{path}: {term.topic} has no element {term.path}: {has}; correct the field in "
            f"{mapping.where}"
        )


def _is_empty(message: object, path: FieldPath) -> bool:
    """Whether the array that a path leads to has no elements."""
    for name, _ in path.steps:
        message = getattr(message, name, None)
        if hasattr(message, "__len__"):
            return len(message) == 0
    return False
