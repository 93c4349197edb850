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

"""The files of a stand that a template gives: description, catalogue, feature table, README."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.configuration.files import text_of
from flea_diag.core.scan_counts import SMOOTHING_S
from flea_diag.tools.stand_folder.channel_file import yaml_text
from flea_diag.tools.stand_folder.seen_values import seen_values

if TYPE_CHECKING:
    from flea_diag.tools.stand_folder.proposal import StandProposal
    from flea_diag.tools.stand_folder.template import Template

STAND = """\
# {title}. Files are named relative to this folder; the calibration is made by flea calibrate.
schema_version: 1
name: {name}
actuator: actuator.yaml
faults: faults.yaml
calibration: calibration.yaml
features: feature_table.yaml
channels: channels.yaml
"""
README = """\
# {name}

{title}, described as the shipped stand `{stand}` is. Made by `flea stand new` from {recording}.

| file | what it holds | to do |
|---|---|---|
| channels.yaml | where channels come from | check the lines that say "check" |
| actuator.yaml | bond graph, parameters, sensors, residuals | screw or gear ratio, travel |
| faults.yaml | fault catalogue | leave out what this actuator cannot have |
| feature_table.yaml | vibration features | learn it anew where there are accelerometers |
| calibration.yaml | made by `flea calibrate` | |

    flea import --stand {folder} {recording} -o bags
    flea calibrate bags/* --stand {folder} -o {folder}/calibration.yaml
    flea replay bags/NAME --stand {folder}

Calibrate with nominal recordings alone, two or more, that cover the motions and loads of later use.
"""


def template_texts(
    kind: Template, folder: Path, recording: str, found: StandProposal | None
) -> dict[str, str]:
    """Name of each file of the folder -> its text, but for channels.yaml.

    ``found`` is None where the recordings have a format of their own.
    """
    name = folder.resolve().name
    stand = kind.stand
    given = {
        "name": yaml_text(name),
        "title": kind.title,
        "stand": stand.name,
        "recording": recording,
        "folder": shown_folder(folder),
    }
    return {
        "stand.yaml": STAND.format(**given),
        "actuator.yaml": _description(kind, text_of(stand.actuator), name, found),
        "faults.yaml": text_of(stand.faults),
        "feature_table.yaml": text_of(stand.features),
        "README.md": README.format(**{**given, "name": name}),
    }


def shown_folder(folder: Path) -> str:
    """A folder as ``--stand`` takes it: with a separator."""
    text = str(folder)
    return text if "/" in text else f"./{text}"


def _split(text: str, key: str) -> tuple[str, str, str]:
    """Text before the line of a top-level key, the line, and text after it."""
    found = re.search(rf"(?m)^{key}: .*$", text)
    if found is None:
        return text, "", ""
    return text[: found.start()], found[0], text[found.end() :]


def _description(kind: Template, text: str, name: str, found: StandProposal | None) -> str:
    """The description of the template with what the recording says."""
    usual = f"{SMOOTHING_S}  # the usual time; check: longer where the slope of a position is noisy"
    lines: dict[str, str] = {"name": yaml_text(name), "smoothing_s": usual}
    if found is not None:
        lines["scan_period_s"] = f"{found.grid.period_s:.6g}  # guessed, because scans come so"
    if found is not None and found.travel is not None and kind.model.travel is not None:
        low, high = found.travel
        lines["travel"] = (
            f"{{at: {kind.model.travel.at}, low_m: {low!r}, high_m: {high!r}}}"
            "  # guessed, because the recording stays within it; check: the hard stops"
        )
    note = (
        f"# That of the shipped stand {kind.stand.name}, taken over with the parameters\n"
        "# of that actuator; check. A calibration replaces those that recordings identify.\n"
    )
    seen = seen_values(found) if found is not None else ()
    note += "".join(f"# Seen in the recording: {words}.\n" for words in seen)
    for key, value in lines.items():
        before, line, after = _split(text, key)
        text = f"{before}{key}: {value}{after}" if line else text
    return note + text
