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

"""Which stamps of a bag are times: those of the headers, unless they stand still or disagree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

STILL = 0.5
"""Share of the messages of a topic that may repeat the stamp of the one before."""
SCATTER, MORE = 0.1, 5.0
"""Scatter of steps, as a share of them, from which on stamps are held against times of receipt; and
how much more regular these must be: nothing is received more evenly than it was sampled."""
MOST_PLACES = 10
"""Places by which messages may be recorded out of the order of their stamps."""
MOST_APART_NS = 2_000_000_000
"""Difference of two topics' clocks from which on they are two clocks."""
FEWEST = 10


def received_topics(
    stamps_ns: Mapping[str, Sequence[int]], logs_ns: Mapping[str, Sequence[int]]
) -> tuple[dict[str, list[int]], tuple[str, ...]]:
    """Topics whose times of receipt serve instead of stamps, with these, and why, a line each.

    Parameters
    ----------
    stamps_ns, logs_ns
        Topic -> stamp and time of receipt of each message, in order of receipt.
    """
    received: dict[str, list[int]] = {}
    notes = []
    for topic, stamps in stamps_ns.items():
        steps = np.diff(np.asarray(stamps, dtype=np.int64))
        if len(steps) >= FEWEST and float(np.mean(steps == 0)) > STILL:
            moved = np.diff(np.asarray(logs_ns[topic], dtype=np.int64))
            if float(np.mean(moved == 0)) < STILL:
                received[topic] = list(logs_ns[topic])
                notes.append(f"{topic}: its stamps stand still: times of receipt are taken instead")
        elif _scatter_more(stamps, logs_ns[topic]):
            received[topic] = _in_order(stamps, logs_ns[topic])
            notes.append(
                f"{topic}: its stamps scatter more than its times of receipt, which are taken "
                "instead"
            )
    offsets = {
        topic: float(np.median(np.subtract(stamps, logs_ns[topic])))
        for topic, stamps in stamps_ns.items()
        if len(stamps) >= FEWEST and topic not in received
    }
    offsets |= dict.fromkeys(received, 0.0)
    if offsets and max(offsets.values()) - min(offsets.values()) > MOST_APART_NS:
        apart_s = (max(offsets.values()) - min(offsets.values())) * 1e-9
        notes.append(
            f"stamps of its topics are of clocks {apart_s:.4g} s apart: times of receipt are taken "
            "for all"
        )
        return {topic: list(logs) for topic, logs in logs_ns.items()}, tuple(notes)
    return received, tuple(notes)


def _in_order(stamps: Sequence[int], logs: Sequence[int]) -> list[int]:
    """Times of receipt, each for the message that its stamp says was sent then."""
    order = np.argsort(np.asarray(stamps, dtype=np.int64), kind="stable")
    if np.abs(order - np.arange(len(order))).max() > MOST_PLACES:
        return list(logs)
    times = np.empty(len(order), dtype=np.int64)
    times[order] = np.sort(np.asarray(logs, dtype=np.int64))
    return [int(each) for each in times]


def _scatter_more(stamps: Sequence[int], logs: Sequence[int]) -> bool:
    """Whether stamps scatter far more than the times of receipt."""
    if len(stamps) < FEWEST:
        return False
    steps = [np.diff(np.asarray(each, dtype=np.float64)) for each in (stamps, logs)]
    usual = float(np.median(steps[0]))
    spread = [float(np.subtract(*np.quantile(each, [0.75, 0.25]))) for each in steps]
    return usual > 0.0 and spread[0] > SCATTER * usual and spread[0] > MORE * spread[1]
