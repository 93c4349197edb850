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

"""``fd.calibrate``: parameters and limits of a stand from nominal recordings."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from flea_diag.api.columns import recording_of
from flea_diag.api.opening import opened
from flea_diag.api.recording import Recording, as_bags
from flea_diag.api.stand import StandFolder
from flea_diag.api.stand_facts import files_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.promise import FALSE_ALARMS_PER_HOUR
from flea_diag.errors import CalibrationError, ConfigurationError
from flea_diag.tools.calibrate.nominal_recording import read_nominal
from flea_diag.tools.calibrate.shared_work import Sharing
from flea_diag.tools.terminal import say

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.tools.calibrate.procedure import CalibrationResult

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False, repr=False)
class Calibrated:
    """What ``fd.calibrate`` learned; give it to ``fd.diagnose`` in place of a stand.

    Parameters
    ----------
    base
        The stand that it was made for.
    found
        Calibration, and the residuals of each recording behind its limits.
    """

    base: StandFolder
    found: CalibrationResult

    @property
    def calibration(self) -> Calibration:
        """Parameters, noise and limits, in SI."""
        return self.found.calibration

    @property
    def left_out(self) -> dict[str, str]:
        """Recording that the others show not to be nominal -> why it was not used."""
        return {row.recording: row.reason for row in self.calibration.left_out}

    @cached_property
    def stand(self) -> StandFolder:
        """The stand with this calibration, kept in a temporary file until it is saved."""
        return self.base.with_calibration(self.save(Path(self._folder.name) / "calibration.yaml"))

    @property
    def files(self) -> Stand:
        """Paths of the files of ``stand``."""
        return self.stand.files

    @cached_property
    def _folder(self) -> tempfile.TemporaryDirectory[str]:
        return tempfile.TemporaryDirectory(prefix="flea_calibration_")

    def save(self, path: str | Path) -> Path:
        """Write the calibration as ``flea calibrate -o`` does.

        Raises
        ------
        ConfigurationError
            The file cannot be written.
        """
        from flea_diag.tools.calibrate.calibrate import write_calibration

        write_calibration(Path(path), self.calibration)
        return Path(path)

    def __repr__(self) -> str:
        """The report that ``flea calibrate`` prints."""
        from flea_diag.tools.calibrate.report import words

        return words(self.calibration, self.found.relations)

    def _repr_html_(self) -> str:
        """The report, for a notebook."""
        from html import escape

        return f"<pre>{escape(repr(self))}</pre>"


def calibrate(
    runs: Sequence[Recording | str | Path | Any],
    stand: StandFolder | str | Path | None = None,
    *,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    progress: bool = False,
    jobs: int = 1,
) -> Calibrated:
    """Identify parameters and limits from nominal recordings of one stand.

    Parameters
    ----------
    runs
        Two recordings or more: what ``fd.open`` returns or takes, or frames as ``fd.diagnose``
        takes them.
    stand
        ``fd.Stand``, name or folder; by default that of the first recording, else the FLEA.
    false_alarms_per_hour
        Rate of all tests together that the limits are set for, per hour of nominal operation.
    progress
        Whether to print each step on standard error.
    jobs
        Processes that share the work; the result is the same.

    Returns
    -------
    Calibrated
        To be saved, or given to ``fd.diagnose``.

    Raises
    ------
    CalibrationError
        Fewer than two usable recordings, no motion, or recordings that contradict each other.
    RecordingError
        A recording cannot be read.
    ConfigurationError
        ``false_alarms_per_hour`` is not above 0, or there is no such stand.
    """
    from flea_diag.configuration.description import compiled_relations
    from flea_diag.tools.calibrate.procedure import learn
    from flea_diag.tools.calibrate.recording_checks import check_bands, check_modes, check_signs

    if not false_alarms_per_hour > 0.0:
        raise ConfigurationError(f"false_alarms_per_hour = {false_alarms_per_hour}: must exceed 0")
    known, recordings = _opened(runs, stand)
    sharing = (Spoken if progress else Sharing)(jobs)
    relations = compiled_relations(known.files.actuator).residuals
    with as_bags(recordings) as bags:
        nominal, refused = read_nominal(bags, relations, sharing)
        if refused:
            raise CalibrationError(refused[0])
        check_signs(nominal, relations)
        check_bands(nominal, relations)
        check_modes(nominal, relations)
        found = learn(nominal, known.files.actuator, false_alarms_per_hour, sharing)
    return Calibrated(known, found)


class Spoken(Sharing):
    """Work whose steps are printed, where no terminal shows a line of progress."""

    def over(
        self, work: Callable[[Item], Result], items: Sequence[Item], step: str
    ) -> Iterator[Result]:
        """Results in the order of the items; see ``Sharing.over``."""
        yield from super().over(work, items, step)
        if not sys.stderr.isatty():
            say(f"{step}: {len(items)} done", file=sys.stderr)


def _opened(runs: Sequence[Any], stand: Any) -> tuple[StandFolder, list[Recording]]:
    """The stand, and every run as a recording."""
    if isinstance(runs, str | Path) or not isinstance(runs, Sequence) or not runs:
        raise CalibrationError("runs must be a list of 2 nominal recordings or more")
    first = runs[0].stand if isinstance(runs[0], Recording) and stand is None else stand
    known = files_of(first)
    return StandFolder(known), [
        opened(run, first)
        if isinstance(run, Recording | str | Path)
        else recording_of(run, known, name=f"frame_{number}")
        for number, run in enumerate(runs, 1)
    ]
