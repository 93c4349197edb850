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

"""The recordings of a campaign: found, imported if they are FLEA files, and used to calibrate.

With ``calibration: halves`` the nominal runs, ordered by name, are dealt into halves A and B.
Each half calibrates once; a nominal run is scored only with the half that it does not belong to.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from flea_diag.errors import ConfigurationError, FleaError, RecordingError, shown
from flea_diag.tools.campaign.campaign import (
    HALVES,
    LISTS,
    Campaign,
    Injections,
    Recordings,
    Switches,
)
from flea_diag.tools.campaign.run_result import NOMINAL
from flea_diag.tools.terminal import progress, warn
from flea_diag.wire.bags.bag_layout import refuse_closed

DATA_FOLDER = "FLEA_DATA_DIR"
FOLDS = ("A", "B")


@dataclass(frozen=True)
class RecordedRun:
    """One recording: its bag, the file that it comes from, and its truth."""

    name: str
    bag: Path
    file: Path
    truth: str
    simulated: bool = False

    @property
    def imported(self) -> bool:
        """Whether the bag is imported from a FLEA file."""
        return self.bag != self.file


class RecordingSet:
    """All recordings that the sources of a campaign name.

    Parameters
    ----------
    campaign
        Its sources name the recordings.
    output
        Folder of the evaluation: imported bags and calibrations are kept there.

    Raises
    ------
    ConfigurationError
        A pattern matches nothing.
    """

    def __init__(self, campaign: Campaign, output: Path) -> None:
        self._campaign = campaign
        self._output = output
        self._known: dict[Path, RecordedRun] = {}
        for source in campaign.sources:
            if isinstance(source, Recordings | Injections | Switches):
                for key in LISTS:
                    self.matching(getattr(source, key, ()), campaign.folder)

    def matching(self, patterns: Sequence[str], folder: Path) -> tuple[RecordedRun, ...]:
        """Runs that match one of the patterns, ordered by name."""
        found: dict[str, RecordedRun] = {}
        for pattern in patterns:
            for path in _paths(pattern, folder):
                run = self._known.get(path) or self._run(path)
                self._known[path] = run
                found[run.name] = run
        return tuple(found[name] for name in sorted(found))

    def _run(self, path: Path) -> RecordedRun:
        if path.suffix == ".data":
            from flea_diag.tools.recordings.flea_run import label_of

            name = path.name.removesuffix(".data")
            label = label_of(name)
            return RecordedRun(
                name, self._output / "bags" / name, path, label.fault if label else ""
            )
        truth, simulated = _told(path)
        return RecordedRun(path.name, path, path, truth, simulated)

    @property
    def halves(self) -> tuple[tuple[RecordedRun, ...], tuple[RecordedRun, ...]]:
        """The nominal runs, dealt into two halves by turns."""
        nominal = sorted((r for r in self._known.values() if r.truth == NOMINAL), key=_by_name)
        return tuple(nominal[::2]), tuple(nominal[1::2])

    def calibrations(self, run: RecordedRun) -> Iterator[tuple[str, str]]:
        """Folds that may score a run, each with its calibration file."""
        if self._campaign.calibration != HALVES:
            yield "", self._campaign.calibration_path()
            return
        for fold, half in zip(FOLDS, self.halves, strict=True):
            if run not in half:
                yield fold, str(self._file_of(fold))

    def learned_from(self, fold: str) -> tuple[str, ...]:
        """Bags that a fold's calibration was learned from."""
        halves = dict(zip(FOLDS, self.halves, strict=True))
        return tuple(str(run.bag) for run in halves.get(fold, ()))

    def _file_of(self, fold: str) -> Path:
        return self._output / "calibrations" / f"{fold}.yaml"

    def prepare(self) -> None:
        """Import FLEA files and calibrate; bags and calibrations that exist are kept.

        Raises
        ------
        ConfigurationError, CalibrationError
            There are too few nominal runs for two halves.
        """
        imported = [run for run in self._known.values() if run.imported]
        for number, run in enumerate(imported, 1):
            progress(number, len(imported), f"importing {run.name}")
            self._import(run)
        if self._campaign.calibration == HALVES:
            for fold, half in zip(FOLDS, self.halves, strict=True):
                self._calibrate(fold, half)

    def _import(self, run: RecordedRun) -> None:
        from flea_diag.tools.recordings.importer import import_run

        if (run.bag / "metadata.yaml").is_file():
            return
        try:
            import_run(run.file, run.bag.parent, force=True)
        except FleaError as error:
            warn(f"{error}; runs that need this recording will fail")

    def _calibrate(self, fold: str, half: Sequence[RecordedRun]) -> None:
        from flea_diag.configuration.description import compiled_relations
        from flea_diag.configuration.stand import load_stand
        from flea_diag.core.calibration.promise import FALSE_ALARMS_PER_HOUR
        from flea_diag.tools.calibrate.calibrate import write_calibration
        from flea_diag.tools.calibrate.nominal_recording import read_nominal
        from flea_diag.tools.calibrate.procedure import calibrate

        if self._file_of(fold).is_file():
            return
        if len(half) < 2:
            raise ConfigurationError(
                f"{self._campaign.name}: half {fold} has {len(half)} nominal recordings, each half "
                "needs at least 2: name more, or give a calibration file"
            )
        stand = load_stand(self._campaign.stand_path())
        known = compiled_relations(stand.actuator).residuals
        recordings, _ = read_nominal([run.bag for run in half], known)
        made = calibrate(recordings, stand.actuator, FALSE_ALARMS_PER_HOUR, faults=stand.faults)
        write_calibration(self._file_of(fold), made)


def _by_name(run: RecordedRun) -> str:
    return run.name


def _paths(pattern: str, folder: Path) -> list[Path]:
    """Files and bags that match a pattern in the campaign's folder or the data folder.

    Raises
    ------
    ConfigurationError
        Nothing matches.
    """
    data = os.environ.get(DATA_FOLDER, "")
    for place in (folder, Path(data)) if data else (folder,):
        anchor, relative = (Path("/"), pattern[1:]) if pattern.startswith("/") else (place, pattern)
        found = [anchor] if relative in ("", ".") else sorted(anchor.glob(relative.rstrip("/")))
        recordings = [path for each in found for path in _recordings(each)]
        if recordings:
            return recordings
    if pattern.startswith("/"):
        raise ConfigurationError(f"no recording matches {shown(pattern)}: no bag, no .data file")
    where = f"{folder} or {data}" if data else f"{folder}; {DATA_FOLDER} is not set"
    raise ConfigurationError(f"no recording matches {shown(pattern)} in {where}")


def _recordings(path: Path) -> Iterator[Path]:
    """The path itself if it is a recording, else the recordings directly below it."""
    refuse_closed(path)
    if path.suffix in (".data", ".mcap") or (path / "metadata.yaml").is_file():
        yield path
    elif path.is_dir():
        below = sorted(path.iterdir())
        yield from (p for p in below if p.suffix == ".data" or (p / "metadata.yaml").is_file())


def _told(bag: Path) -> tuple[str, bool]:
    """First fault in a bag's truth, and whether the bag is simulated."""
    from flea_diag.wire.bags.bag import read_bag
    from flea_diag.wire.records import ChannelTable, Truth

    faults, simulated = [], False
    try:
        for _, record in read_bag(bag, (Truth, ChannelTable)):
            if isinstance(record, Truth):
                faults.append(record.fault)
            elif isinstance(record, ChannelTable):
                simulated = record.stand.endswith("_sim")
    except RecordingError:
        return "", False
    wrong = [fault for fault in faults if fault not in ("", NOMINAL)]
    return (wrong or faults or [""])[0], simulated
