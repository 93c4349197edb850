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

"""``fd.Stand``: the folder that a diagnosis rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.api.opening import opened
from flea_diag.api.recording import Recording, as_bags
from flea_diag.api.stand_facts import channels_of
from flea_diag.configuration.files import given_file
from flea_diag.configuration.stand import Stand, load_stand, shipped_stands

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration


@dataclass(frozen=True)
class StandFolder:
    """A stand: description, fault catalogue, calibration, features, and where channels come from.

    ``fd.Stand.load("flea")`` gives a shipped one, ``fd.Stand.new`` writes one of your own.

    Parameters
    ----------
    files
        Paths of its files.
    """

    files: Stand

    @staticmethod
    def load(name_or_folder: str | Path = "", calibration: str | Path = "") -> StandFolder:
        """A stand by the name of a shipped one, or by its folder as a path (``./mine``).

        Parameters
        ----------
        name_or_folder
            Empty: the shipped FLEA.
        calibration
            File that replaces the stand's own.

        Raises
        ------
        ConfigurationError
            There is no such stand or file; the message names the shipped ones.
        """
        return StandFolder(load_stand(name_or_folder, calibration=calibration))

    @staticmethod
    def shipped() -> tuple[str, ...]:
        """Names of the stands that come with flea_diag."""
        return tuple(shipped_stands())

    @staticmethod
    def new(
        folder: str | Path,
        recording: str | Path,
        *,
        template: str = "",
        joint: str = "",
        rate_hz: float | None = None,
    ) -> StandFolder:
        """Write the folder of a stand from one of its recordings; every guess is marked there.

        Parameters
        ----------
        folder
            To write, new or empty.
        recording
            CSV, NPZ, Parquet, a bag of ROS 2 or ROS 1, text of the FLEA.
        template
            Kind of actuator, such as ``dc_screw``; empty: the one that fits.
        joint
            Joint of a JointState to diagnose; empty: one that moves.
        rate_hz
            Rate of the rows in Hz, for a table without a column of times.

        Raises
        ------
        FleaError
            The folder is in use, the recording cannot be read, or no template fits it.
        """
        from argparse import Namespace

        from flea_diag.tools.stand_folder.new import run

        run(Namespace(folder=Path(folder), recording=Path(recording), template=template,
                      joint=joint, rate=rate_hz))  # fmt: skip
        return StandFolder.load(Path(folder).absolute())

    def check(self, runs: Sequence[Recording | str | Path]) -> dict[str, Any]:
        """What healthy recordings of the stand are good for, as ``flea stand check --json``.

        Parameters
        ----------
        runs
            Recordings, or paths that ``fd.open`` takes.

        Returns
        -------
        dict
            Channels with noise (SI), faults with the sizes that will be seen, what is missing.

        Raises
        ------
        RecordingError
            A recording cannot be used.
        """
        from flea_diag.tools.stand_check.page_text import as_mapping
        from flea_diag.tools.stand_check.recorded_motion import recorded_motions
        from flea_diag.tools.stand_check.stand_page import stand_page

        with as_bags([opened(run, self.files) for run in runs]) as bags:
            motions = [motion for bag in bags for motion in recorded_motions(bag, self.files)]
        return as_mapping(stand_page(self.files, motions))

    def with_calibration(self, path: str | Path) -> StandFolder:
        """The same stand with another calibration file.

        Raises
        ------
        ConfigurationError
            There is no such file.
        """
        return StandFolder(replace(self.files, calibration=given_file(path)))

    @property
    def name(self) -> str:
        """Name of the stand."""
        return self.files.name

    @cached_property
    def channels(self) -> dict[str, str]:
        """Channel -> unit (SI, temperatures in degC) of all that the description measures."""
        return channels_of(self.files)

    @cached_property
    def faults(self) -> dict[str, str]:
        """Fault of the catalogue -> the component and channel that it is a fault of."""
        from flea_diag.configuration.description import faults_of

        rows = faults_of(self.files.actuator, self.files.faults)
        return {name: f"{row.component} {row.channel}".strip() for name, row in rows.items()}

    @property
    def calibration(self) -> Calibration:
        """Parameters, noise and limits, in SI.

        Raises
        ------
        ConfigurationError
            There is none; the message has the command that makes one.
        CalibrationError
            It was made for another description.
        """
        from flea_diag.configuration.calibrations import learned

        return learned(self.files)
