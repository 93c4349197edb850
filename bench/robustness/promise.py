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

"""What calibrations of few recordings state, support and do: alarms on the recordings left over.

python bench/robustness/promise.py      the FLEA's nominal recordings below FLEA_DATA_DIR
python bench/robustness/promise.py bags/*Nominal* --seed 7

3, 6, 12 and 24 nominal recordings are drawn at random for a calibration; every other one is
diagnosed with it. An alarm is any episode. Stated is the rate that the limits were set for,
supported the upper bound (95 %) that the recordings of the calibration give, observed the alarms
per hour on the others.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, write_summary

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.calibrate.nominal_recording import NominalRecording, read_nominal
from flea_diag.tools.calibrate.procedure import calibrate
from flea_diag.tools.evaluate.case_run import CaseDiagnosis, diagnose
from flea_diag.tools.main import main as main_of
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, DataQuality, Scan
from flea_diag.wire.vocabulary import OUTSIDE_CALIBRATION

SIZES = (3, 6, 12, 24)
STATED_PER_HOUR = 0.1


def imported(folder: Path, kind: str = "Nominal") -> list[Path]:
    """Bags of the recordings of the FLEA of this kind."""
    files = Path(os.environ.get("FLEA_DATA_DIR", "../shared/data")).glob(f"flea/*_{kind}_*.data")
    if main_of(["import", *sorted(map(str, files)), "-o", str(folder)]):
        raise SystemExit("no recordings: name bags, or the folder of recordings by FLEA_DATA_DIR")
    return sorted(folder.iterdir())


def diagnosis(bag: Path, calibration: Path) -> CaseDiagnosis:
    """What the stages say of a recording with this calibration."""
    stand = load_stand(calibration=str(calibration))
    records = (record for _, record in BagReader(bag).records((ChannelTable, Scan)))
    return diagnose(records, make_pipeline(stand))


def episodes(done: CaseDiagnosis) -> list[AmbiguityGroup]:
    """The last group of each episode."""
    groups = (record for record in done.kept if isinstance(record, AmbiguityGroup))
    return list({group.episode: group for group in groups if group.episode}.values())


def diagnosed(bag: Path, calibration: Path) -> list[AmbiguityGroup]:
    """The last group of each episode in a recording."""
    return episodes(diagnosis(bag, calibration))


def outside_s(done: CaseDiagnosis, duration_s: float) -> float:
    """Time of a run in which something was not tested for lying outside the calibration."""
    told = [record for record in done.kept if isinstance(record, DataQuality)]
    ends = done.start_ns + round(duration_s * 1e9)
    edges = [*(record.stamp_ns for record in told), ends]
    outside_ns = sum(
        after - record.stamp_ns
        for record, after in zip(told, edges[1:], strict=True)
        if any(row.channel == OUTSIDE_CALIBRATION for row in record.channels)
    )
    return outside_ns / 1e9


def of_size(
    bags: dict[str, Path], recordings: list[NominalRecording], size: int, seed: int, folder: Path
) -> list[Figure]:
    """One calibration: its promise, and what it does on the recordings left over."""
    drawn = set(np.random.default_rng((seed, size)).permutation(len(recordings))[:size].tolist())
    given = [row for k, row in enumerate(recordings) if k in drawn]
    rest = [row for k, row in enumerate(recordings) if k not in drawn]
    made = calibrate(given, load_stand().actuator, STATED_PER_HOUR)
    target = folder / f"calibration_{size}.yaml"
    write_calibration(target, made)
    found = sum(len(diagnosed(bags[row.run.name], target)) for row in rest)
    hours = sum(len(row.run.rows) * row.period_s for row in rest) / 3600.0
    supported = made.promise.supported_per_hour
    print(
        f"{size:3d} recordings: {STATED_PER_HOUR:g} per hour stated, {supported:.3g} supported; "
        f"observed {found} in {hours:.3f} h of {len(rest)} others",
        flush=True,
    )
    return [
        Figure(f"{size} recordings: supported, at most", supported, "per hour", size),
        Figure(
            f"{size} recordings: observed", found / hours, f"per hour, {hours:.3f} h", len(rest)
        ),
    ]


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("bags", nargs="*", type=Path, help="nominal bags")
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    figures = []
    with TemporaryDirectory() as folder:
        bags = {bag.name: bag for bag in arguments.bags or imported(Path(folder, "bags"))}
        known = compiled_relations(load_stand().actuator).residuals
        recordings, _ = read_nominal(list(bags.values()), known)
        for size in SIZES:
            figures += of_size(bags, recordings, size, arguments.seed, Path(folder))
    write_summary("promise", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
