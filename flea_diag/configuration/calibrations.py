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

"""Calibrations: read, told apart, and refused with another description than their own."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path

from flea_diag.configuration.description import (
    compiled_relations,
    described,
    description_sha256,
)
from flea_diag.configuration.files import found_file, parsed, text_of
from flea_diag.configuration.stand import Stand, load_stand, shipped_stands
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.calibration_reader import from_mapping
from flea_diag.core.residuals.parameters import actuator_parameters
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.errors import CalibrationError, ConfigurationError, shown


def load_calibration(path: str | Path) -> Calibration:
    """Calibration from a file, whatever actuator it is for."""
    return _calibration(str(path), text_of(found_file(path)))


@lru_cache(maxsize=8)
def _calibration(name: str, text: str) -> Calibration:
    """Parsed calibration, cached since parsing takes longer than diagnosing minutes of data."""
    return from_mapping(parsed(text, Path(name)), name)


def calibration_sha256(calibration: Calibration) -> str:
    """Digest of what was learned, independent of the layout of its file.

    The digest of the description is not part of it: a file from before it was written says the
    same.
    """
    content = calibration.to_mapping()
    del content["actuator_sha256"]
    content["schema_version"] = 1  # an older file says the same
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def learned(stand: Stand) -> Calibration:
    """Calibration of a stand.

    Raises
    ------
    CalibrationError
        It is refused, or was made with another description than the stand's.
    ConfigurationError
        It cannot be read, or the description is refused.
    """
    if not stand.calibration.exists():
        raise ConfigurationError(
            f"{stand.calibration}: no such calibration: make it with "
            f"flea calibrate BAGS --stand {stand.folder} -o {stand.calibration}"
        )
    calibration = load_calibration(stand.calibration)
    require_description(calibration, stand)
    return _completed(calibration, stand)


def law_of(stand: Stand) -> RunLaw:
    """Law of healthy recordings in the calibration of a stand.

    Raises
    ------
    ConfigurationError
        The calibration holds none.
    """
    law = learned(stand).law
    if law is None:
        raise ConfigurationError(
            f"{stand.calibration} holds no law of healthy recordings: learn it from nominal ones "
            f"by flea calibrate BAGS --stand {stand.folder} -o {stand.calibration} --law-only, or "
            "name them under `learn_from` in a campaign"
        )
    return law


def _completed(calibration: Calibration, stand: Stand) -> Calibration:
    """With the description's values of further parameters that an older file does not hold."""
    stated, known = compiled_relations(stand.actuator).described, asdict(calibration.parameters)
    lacking = {name: value for name, value in stated.items() if name not in known}
    if not lacking:
        return calibration
    return replace(calibration, parameters=actuator_parameters({**lacking, **known}))


def require_description(calibration: Calibration, stand: Stand) -> None:
    """Refuse a calibration that was made with another description than the stand's.

    One from before the digest was written is known by the name of its actuator alone.

    Raises
    ------
    CalibrationError
        Names both, and the shipped stand that it is for.
    """
    name, digest = described(stand.actuator).name, description_sha256(stand.actuator)
    known = calibration.actuator_sha256
    if name == calibration.actuator and known in ("", digest):
        return
    said = f" (sha256 {known[:12]})" if known else ""
    own = stand.folder in stand.actuator.parents
    option = f"--stand {stand.folder}" if own else f"--actuator {stand.actuator}"
    raise CalibrationError(
        f"{stand.calibration}: made for actuator {shown(calibration.actuator)}{said}, "
        f"{stand.actuator} describes {shown(name)} (sha256 {digest[:12]}): "
        f"{_fitting(calibration)}calibrate again with flea calibrate {option}"
    )


def _fitting(calibration: Calibration) -> str:
    """The shipped stand that a calibration is for, as a remedy; empty where there is none."""
    for name in shipped_stands():
        path = load_stand(name).actuator
        same = description_sha256(path) == calibration.actuator_sha256
        if same or (
            not calibration.actuator_sha256 and described(path).name == calibration.actuator
        ):
            return f"give stand {name}, or "
    return ""
