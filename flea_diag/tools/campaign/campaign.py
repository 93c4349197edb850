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

"""A campaign file: the runs, and the answer that is right for each truth.

Values are read from YAML and checked: unknown keys, wrong types and sizes beyond a limit are
refused by name. Files are looked for in the campaign's own folder, then in the folder that the
environment variable FLEA_DATA_DIR names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE
from flea_diag.formats import migrated
from flea_diag.tools.campaign.run_result import NOMINAL
from flea_diag.wire.parameters import parameter

HYBRID = "hybrid"
"""The diagnoser as `flea replay` runs it; others are baselines."""
CLASSIFIER = "feature_classifier"
"""The configuration that needs a network."""
HALVES = "halves"
"""Cross-calibration: each half of the nominal recordings calibrates for the other half."""

LARGEST_LIST = 10_000
LONGEST_NAME = 100


@dataclass(frozen=True)
class FaultCases:
    """One row of a drawn source: a fault, its number of runs, and its range of sizes."""

    title: str = parameter("", "name of the row")
    fault: str = parameter("", "id of the catalogue, empty: nominal")
    cases: int = parameter(1, "number of runs", minimum=1, maximum=LARGEST_LIST)
    low: float = parameter(0.0, "smallest size")
    high: float = parameter(0.0, "largest size; 0: the catalogue's default")
    either_sign: bool = parameter(False, "the sign of the size is drawn as well")
    switched: bool = parameter(
        False, "the fault, if any, comes with a switch to the unit that has it"
    )
    warmer_k: float = parameter(
        0.0, "by how much that unit is warmer at the start", unit="K", minimum=-20.0, maximum=60.0
    )
    sizes: tuple[float, ...] = field(default=())
    """A ladder of sizes, used in turn, instead of draws between low and high."""

    def __post_init__(self) -> None:
        """Check that the range of sizes is none that is empty."""
        if self.high < self.low:
            raise ValueError(f"high = {self.high!r} is below low = {self.low!r}")


@dataclass(frozen=True)
class Drawn:
    """Runs of the simulated stand, drawn like the scenarios of the paper's Table 4."""

    name: str = parameter("drawn", "first part of the names of the runs")
    machine: str = parameter("flea", "simulated machine: name of a shipped one, or a YAML file")
    seed: int = parameter(1, "of all draws", minimum=0, maximum=2**31)
    unit_seed: int = parameter(
        -1, "of the units of all runs; -1: a unit of its own in each", minimum=-1, maximum=2**31
    )
    times: int = parameter(1, "multiplies the cases of each row", minimum=1, maximum=1000)
    duration_s: float = parameter(40.0, "length", unit="s", minimum=10.0, maximum=86400.0)
    earliest_onset_s: float = parameter(12.0, "of a fault", unit="s", minimum=0.0)
    latest_onset_s: float = parameter(18.0, "of a fault", unit="s", minimum=0.0)
    unit_spread: float = parameter(1.0, "scale of all spreads", minimum=0.0, maximum=3.0)
    vibration: bool = parameter(True, "sample the accelerometers")
    voltage: str = parameter("mean", "how the voltage is sampled", choices=("mean", "instant_pwm"))
    spread: Mapping[str, float] = field(default_factory=dict)
    """Relative standard deviations between units that replace those of the stand."""
    rows: tuple[FaultCases, ...] = ()


@dataclass(frozen=True)
class Scenarios:
    """Runs of the simulated stand by scenario: names of shipped scenarios, or YAML files."""

    name: str = parameter("scenarios", "first part of the names of the runs")
    machine: str = parameter("", "simulated machine; empty: that of each scenario")
    seed: int = parameter(1, "of the first run of each scenario", minimum=0, maximum=2**31)
    times: int = parameter(1, "runs of each, with consecutive seeds", minimum=1, maximum=1000)
    vibration: bool = parameter(True, "sample the accelerometers")
    files: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recordings:
    """Recorded runs: bags, folders of bags, FLEA .data files; ``*`` matches anything."""

    name: str = parameter("recordings", "first part of the names of the runs")
    files: tuple[str, ...] = ()


@dataclass(frozen=True)
class Injections:
    """Software faults injected into recorded nominal runs, after the DAQ."""

    name: str = parameter("injections", "first part of the names of the runs")
    seed: int = parameter(1, "of all draws", minimum=0, maximum=2**31)
    cases: int = parameter(60, "of each row or rung", minimum=1, maximum=LARGEST_LIST)
    ladder: bool = parameter(False, "a ladder of sizes instead of drawn sizes")
    files: tuple[str, ...] = ()
    rows: tuple[str, ...] = ()
    """Channel and mode (``motor_current bias``); empty: all."""


@dataclass(frozen=True)
class Switches:
    """A recorded nominal run that switches to a faulty one of the same motion and load."""

    name: str = parameter("switches", "first part of the names of the runs")
    margin_s: float = parameter(
        12.0, "least time from the start of the nominal run to the switch", unit="s", minimum=0.0
    )
    nominal: tuple[str, ...] = ()
    faulty: tuple[str, ...] = ()


Source = Drawn | Scenarios | Recordings | Injections | Switches
SOURCES: dict[str, type[Any]] = {
    "drawn": Drawn,
    "scenarios": Scenarios,
    "recordings": Recordings,
    "injections": Injections,
    "switches": Switches,
}
LISTS = ("files", "nominal", "faulty")
MAY_BE_ONE = (*LISTS, "rows", "configurations", "learn_from")


@dataclass(frozen=True)
class Campaign:
    """All of a campaign file."""

    name: str = parameter("campaign", "for people")
    stand: str = parameter("flea", "name of a shipped stand, or the folder of one as a path")
    calibration: str = parameter("", "a file; empty: the stand's; halves: cross-calibration")
    classifier: str = parameter(
        "", "network that `flea features train` made, for the configuration feature_classifier"
    )
    limit_percent: float = parameter(
        0.0, "least share of right runs in each row", minimum=0.0, maximum=100.0
    )
    configurations: tuple[str, ...] = (HYBRID,)
    learn_from: tuple[str, ...] = ()
    """Nominal bags for baselines that learn, where the runs themselves are not used."""
    expect: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Truth -> faults that a right group may hold, if not the truth alone."""
    sources: tuple[Source, ...] = ()
    folder: Path = Path()

    def stand_path(self) -> str:
        """The stand as ``load_stand`` takes it: a path is one from the campaign's folder."""
        from flea_diag.configuration.files import is_bare

        return self.stand if is_bare(self.stand) else str((self.folder / self.stand).resolve())

    def calibration_path(self) -> str:
        """The calibration file: in the campaign's folder, else shipped; empty: the stand's.

        Raises
        ------
        ConfigurationError
            A bare name is neither.
        """
        from flea_diag.configuration.files import config_path, is_bare

        if self.calibration in ("", HALVES):
            return ""
        path = self.folder / self.calibration
        bare = is_bare(self.calibration) and not path.is_file()
        return str(config_path(self.calibration) if bare else path)

    def expected(self, truth: str) -> tuple[str, ...]:
        """Faults that a right final group may hold; empty: no alarm is expected."""
        return expected_of(truth, self.expect)


def expected_of(truth: str, expect: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Entry of ``expect`` for a truth, else the truth alone; empty for a nominal run."""
    return expect.get(truth, () if truth == NOMINAL else (truth,))


def load_campaign(path: Path) -> Campaign:
    """Campaign of a YAML file, or of a folder of recordings.

    Raises
    ------
    ConfigurationError
        Naming the file, the key, the value and its limit.
    """
    if path.is_dir():
        source = Recordings(name=path.resolve().name, files=(str(path.resolve()),))
        return Campaign(name=path.resolve().name, sources=(source,))
    from flea_diag.configuration.files import load_yaml

    found = path.absolute() if path.exists() or path.parent != Path() else _shipped(path)
    return campaign_from_mapping(load_yaml(found), str(path), found.resolve().parent)


def _shipped(name: Path) -> Path:
    from flea_diag.configuration.files import config_path

    return config_path(f"campaigns/{name.name}")


def _check_names(names: Iterable[str], where: str) -> None:
    """Refuse names that lead elsewhere: results lie in folders named after them."""
    for name in names:
        if (
            "/" in name
            or "\0" in name
            or name.strip() in ("", ".", "..")
            or len(name) > LONGEST_NAME
        ):
            raise ConfigurationError(
                f"{where}: name = {shown(name)} names no folder: no '/', not '.' or '..', 1 to "
                f"{LONGEST_NAME} characters"
            )


def campaign_from_mapping(content: Any, where: str, folder: Path = Path()) -> Campaign:
    """Campaign from the content of a YAML file; see ``load_campaign``."""
    known = _listed(migrated("campaign", content, where))
    rows = read_as(tuple[dict[str, Any], ...], known.pop("sources", None), f"{where}: sources")
    _count(rows, f"{where}: sources")
    made = tuple(_source(row, f"{where}: sources[{k}]") for k, row in enumerate(rows))
    names = [source.name for source in made]
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise ConfigurationError(f"{where}: two sources are named {shown(double[0])}, rename one")
    given = {"sources": made, "folder": folder}
    campaign = read_as(Campaign, known, where, magnitudes=FINITE, given=given)
    _check_names((campaign.name, *names), where)
    _count(campaign.configurations, f"{where}: configurations")
    return campaign


def _source(content: Mapping[str, Any], where: str) -> Source:
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in SOURCES:
        raise ConfigurationError(
            f"{where}: kind = {shown(kind)} is unknown, choose one of {', '.join(SOURCES)}"
        )
    values = {key: value for key, value in _listed(content).items() if key != "kind"}
    source: Source = read_as(SOURCES[kind], values, where, magnitudes=FINITE)
    for key in LISTS:
        _count(getattr(source, key, ("none",)), f"{where}: {key}")
    if isinstance(source, Drawn):
        _count(source.rows, f"{where}: rows")
        titled = (replace(r, title=r.title or r.fault or "Nominal") for r in source.rows)
        return replace(source, rows=tuple(titled))
    return source


def _listed(content: Mapping[str, Any]) -> dict[str, Any]:
    """The same with lists where one text may stand for a list of one."""
    texts = {k: [v] for k, v in content.items() if k in MAY_BE_ONE and isinstance(v, str)}
    expect = content.get("expect")
    if isinstance(expect, Mapping):
        texts["expect"] = {k: [v] if isinstance(v, str) else v for k, v in expect.items()}
    return {**content, **texts}


def _count(entries: Sequence[Any], where: str) -> None:
    if not 0 < len(entries) <= LARGEST_LIST:
        raise ConfigurationError(f"{where} must be a list of 1 to {LARGEST_LIST} entries")
