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

"""Everything that reads JSON of others, each reader with a whole text."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from flea_diag.core.choice.classifier import Perceptron
from flea_diag.errors import RecordingError
from flea_diag.formats import stamped
from flea_diag.nodes.operator.alarm_row import alarm_of, text_of
from flea_diag.operator.alarm import Alarm, Member
from flea_diag.tools.campaign.result_log import read_results
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.campaign.run_trace import RunTrace, read_trace, trace_path
from flea_diag.tools.features.classifier import read_classifier
from flea_diag.tools.score.decision import read_decisions
from flea_diag.tools.score.report_drawing import picture
from flea_diag.wire.bags.bag_reader import BagReader
from flea_diag.wire.records import Outcome, Symbol
from support.places import ROOT

Put = Callable[[str, bytes], Path]
"""Makes a file of a name and a content."""


def json_readers(put: Put) -> dict[str, tuple[Callable[[bytes], object], bytes]]:
    """Each reader with what it reads."""
    return {
        "alarm row": (_read_alarm, _alarm()),
        "run result": (lambda text: read_results(put("results.jsonl", text)), _result()),
        "replay summary": (lambda text: read_decisions(put("replay.json", text)), _summary()),
        "run trace": (lambda text: _read_trace(put("run.json", b""), text), _trace()),
        "classifier": (lambda text: read_classifier(put("classifier.json", text)), _network()),
    }


def _read_alarm(content: bytes) -> object:
    try:
        return alarm_of("live", 5000, content.decode("utf-8", "replace"), -1, "")
    except ValueError as error:
        raise RecordingError(str(error)) from error


def _read_trace(detail: Path, content: bytes) -> object:
    """Read and drawn; what cannot be read counts as none."""
    trace_path(detail).write_bytes(gzip.compress(content, 1))
    trace = read_trace(detail)
    return trace and picture(RunResult("a", "real", "jam", detail="run.json"), trace)


def _alarm() -> bytes:
    jam = Member("jam", 1.0, float("nan"), 0.1, "N")
    deviation = Symbol("parity_mechanical", "+", "0", 5)
    alarm = Alarm(
        "live", 5000, 1, "parity_mechanical", 6.5, 5.0, "z", Outcome.ISOLATED, "jam", 6000,
        (jam,), (deviation,),
    )  # fmt: skip
    return text_of(alarm).encode()


def _result() -> bytes:
    line = RunResult("a", "real", "jam", group=("jam",), probabilities=(1.0,), onset_s=3.0)
    return line.to_line().encode() + b"\n"


def _summary() -> bytes:
    step = {"at_s": 1.0, "outcome": "ISOLATED", "members": ["jam"]}
    episode = {
        "outcome": "ISOLATED", "detected_at_s": 1.0, "ambiguity_group": ["jam"], "steps": [step],
        "detected_by": "parity_mechanical", "kept": {"jam": "why"}, "dropped": {"spall": "why"},
    }  # fmt: skip
    summary = {
        "bag": "jam", "outcome": "ISOLATED", "ambiguity_group": ["jam"], "digest": "0",
        "episodes": [episode],
    }  # fmt: skip
    return json.dumps(stamped("replay summary", summary)).encode()


def _trace() -> bytes:
    trace = RunTrace()
    for _, record in BagReader(ROOT / "bags" / "winding_short").records():
        trace.add(record)
    return json.dumps(stamped("run trace", trace.to_mapping())).encode()


def _network() -> bytes:
    layers = ((np.ones((1, 2)), np.zeros(2)),)
    network = Perceptron(("crest",), ("jam", "spall"), np.zeros(1), np.ones(1), layers)
    return json.dumps(network.as_mapping()).encode()
