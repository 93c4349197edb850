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

"""All commands on one machine, one after the other, and what is wrong with their answers."""

from __future__ import annotations

import io
import traceback
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flea_diag.configuration.description import described
from flea_diag.tools.main import main
from support.machines.description import random_description
from support.machines.recordings import write_recordings, write_stand
from support.places import ROOT

VIEWS = ("equations", "signatures", "diagnosability")
REFUSED = 2


@dataclass
class Answers:
    """Exit status of each command and what it said; a traceback has the status -1."""

    status: dict[str, int] = field(default_factory=dict)
    said: dict[str, str] = field(default_factory=dict)

    def call(self, name: str, *words: object) -> int:
        """Give a command, and keep its answer."""
        errors = io.StringIO()
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(errors):
                self.status[name] = main([str(word) for word in words])
        except Exception:
            self.status[name], trace = -1, traceback.format_exc()
            self.said[name] = trace
            return -1
        self.said[name] = errors.getvalue().strip()
        return self.status[name]

    def wrong(self) -> Iterator[str]:
        """Tracebacks, commands that disagree about the description, files that nobody reads."""
        for name, status in self.status.items():
            if status == -1:
                yield f"{name}: {self.said[name]}"
        first = self.said["equations"]
        for name in (*VIEWS, "import", "check"):
            refused = REFUSED in (self.status["equations"], self.status.get(name))
            if refused and self.said.get(name, first) != first:
                yield f"{name} says {self.said[name]!r}, equations {first!r}"
        for name in ("replay", "check again"):
            if self.status.get(name) == REFUSED:
                yield f"{name}: {self.said[name]}"
        for name, words in self.said.items():
            if self.status[name] == REFUSED and "\n" in words and name in (*VIEWS, "replay"):
                yield f"{name} says more than a line: {words}"


def through_all(seed: int, folder: Path, recorded: bool = True) -> Answers:
    """What all commands say of the machine of a seed; without recordings those of the model."""
    rng = np.random.default_rng(seed)
    stand, answers = folder / "stand", Answers()
    write_stand(random_description(rng), stand, ROOT / "config" / "feature_table_paper.yaml")
    for view in VIEWS:
        answers.call(view, "model", view, "--stand", stand)
    if not recorded:
        return answers
    files = [folder / "none.csv"]
    if answers.status["equations"] == 0:
        files = write_recordings(described(stand / "actuator.yaml"), rng, folder)
    answers.call("import", "import", "--stand", stand, *files, "-o", folder / "bags")
    answers.call("check", "stand", "check", stand, *files)
    bags = [folder / "bags" / file.stem for file in files]
    if answers.status["import"] == 0:
        _calibrated(answers, stand, bags, files)
    return answers


def _calibrated(answers: Answers, stand: Path, bags: list[Path], files: list[Path]) -> None:
    """Calibrate, and use the calibration where one was written."""
    path = stand / "calibration.yaml"
    answers.call("calibrate", "calibrate", *bags, "--stand", stand, "-o", path)
    if path.exists():
        answers.call("replay", "replay", bags[0], "--stand", stand)
        answers.call("check again", "stand", "check", stand, *files)
