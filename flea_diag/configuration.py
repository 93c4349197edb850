"""Finds and reads the configuration files, and builds the stages for nodes and tools.

The only place where files become core objects. YAML is read safely (bounded size, no
constructors), by path or by name from the installed ``config`` folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, make_dataclass
from functools import cache, lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from flea_diag.core.backend import compiling
from flea_diag.core.bond_graph.actuator import Actuator
from flea_diag.core.bond_graph.actuator import actuator as read_actuator
from flea_diag.core.calibration import calibration as calibrations
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant
from flea_diag.core.choice.diagnosis_tree import Node, asked_tree
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.drawing.causal_map import CausalMap, causal_map
from flea_diag.core.faults.fault import Fault, catalogue
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet, relation_set
from flea_diag.core.residuals.residual import RELATIONS, UNIT_PARAMETERS
from flea_diag.core.residuals.thermal import OF_THERMAL_NODES
from flea_diag.core.signatures.signature import SignatureTable, signature_table
from flea_diag.core.vibration.features import try_out
from flea_diag.errors import CalibrationError, ConfigurationError, shown
from flea_diag.stages import Stage
from flea_diag.stages.extractor.extractor import ExtractorParameters, ExtractorStage
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage, Knowledge
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import Scan, VibrationBlock
from flea_diag.wire.regular_file import read_text
from flea_diag.wire.yaml_text import parse_yaml

LARGEST_YAML_BYTES = 1 << 20
WARM_UP_SCANS = 60
"""Number of scans of the warm-up, more than the delay of the smoothing."""
CALIBRATION = "calibration_simulated_stand.yaml"
Planner = Callable[..., Node]
"""``asked_tree`` with a bound chooser: (group, asked, rarest) -> Node."""
PACKAGE = Path(__file__).resolve().parent


def config_folders() -> tuple[Path, ...]:
    """Folders that may contain the configuration, nearest first.

    The source tree of the package, the prefix of its installation, the prefixes of
    AMENT_PREFIX_PATH, the prefix of the Python environment.
    """
    share = Path("share", "flea_diag", "config")
    source = PACKAGE.parent
    found = [source / "config"] if (source / "package.xml").is_file() else []
    found += [parent / share for parent in PACKAGE.parents[:6]]
    found += [Path(p) / share for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]
    return tuple(dict.fromkeys([*found, Path(sys.prefix) / share]))


def config_path(name: str) -> Path:
    """Path of a file of the shipped configuration.

    Raises
    ------
    ConfigurationError
        There is no such file; names the folders searched.
    """
    for folder in config_folders():
        if (folder / name).exists():
            return folder / name
    places = ", ".join(str(folder) for folder in config_folders() if folder.is_dir()) or "none"
    raise ConfigurationError(
        f"{name}: no such configuration file (configuration folders found: {places})"
    )


def load_yaml(name_or_path: str | Path) -> Any:
    """Content of a YAML file, given by path or by the name of a shipped file.

    Raises
    ------
    ConfigurationError
        The file does not exist, is too large, or is not YAML.
    """
    path = found_file(name_or_path)
    return _parsed(_text(path), path)


def _parsed(text: str, path: Path) -> Any:
    try:
        return parse_yaml(text)
    except ValueError as error:
        raise ConfigurationError(f"{path}: not a YAML file: {error}") from error


def found_file(name_or_path: str | Path) -> Path:
    """Path of a file given by path, or by the name of a shipped file.

    Raises
    ------
    ConfigurationError
        The file does not exist.
    """
    path = Path(name_or_path)
    if path.exists() and not path.is_dir():
        return path
    if path.parent != Path("."):
        raise ConfigurationError(f"{path}: no such file")
    return config_path(path.name)


def _text(path: Path) -> str:
    try:
        return read_text(path, LARGEST_YAML_BYTES, ConfigurationError)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error


def load_calibration(path: str | Path) -> Calibration:
    """Calibration from a file; an empty path is the one shipped for the simulated stand."""
    name = str(path) or CALIBRATION
    return _calibration(name, _text(found_file(name)))


@lru_cache(maxsize=8)
def _calibration(name: str, text: str) -> Calibration:
    """Parsed calibration, cached since parsing takes longer than diagnosing minutes of data."""
    return calibrations.from_mapping(_parsed(text, Path(name)), name)


def calibration_sha256(calibration: Calibration) -> str:
    """Digest of the content of a calibration, independent of the layout of its file."""
    text = json.dumps(calibration.to_mapping(), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def load_features(name: str) -> FaultFeatureTable:
    """Fault feature table from a file."""
    return FaultFeatureTable.from_mapping(load_yaml(name), name)


def knowledge(
    calibration: Calibration,
    actuator: str = "actuator.yaml",
    faults: str = "faults.yaml",
    features: str = "feature_table.yaml",
) -> Knowledge:
    """Knowledge of the isolator: fault catalogue and signatures for the sensors of this stand.

    Raises
    ------
    CalibrationError
        The calibration belongs to another actuator than described.
    """
    name, rows, tables = _signatures(actuator, faults, calibration.channels, calibration.period_s)
    require_actuator(calibration, name, actuator)
    table = load_features(features).of_vibration()
    known = relations(calibration, actuator)
    return Knowledge(calibration, calibration_sha256(calibration), known, rows, tables, table)


def require_actuator(calibration: Calibration, name: str, where: str) -> None:
    """Refuse a calibration of another actuator than described.

    Raises
    ------
    CalibrationError
        Names both.
    """
    if name != calibration.actuator:
        raise CalibrationError(
            f"the calibration is for actuator {shown(calibration.actuator)}, {where} describes "
            f"{shown(name)}: choose the matching description, or calibrate this actuator"
        )


def relations(calibration: Calibration, actuator: str = "actuator.yaml") -> RelationSet:
    """The relations that run, for the sensors and parameters of a calibration.

    Raises
    ------
    ConfigurationError
        The calibration has identified a parameter that no relation of this description holds.
    """
    has_encoder = calibration.parameters.encoder_m_per_rad != 0.0
    drawn = compiled_relations(actuator).parameters
    for name in calibration.sigmas:
        if name not in drawn and name not in OF_THERMAL_NODES:
            raise ConfigurationError(
                f"{actuator}: no relation holds {name}, which the calibration has identified; draw "
                "it and name it under base_parameters, as config/actuator.yaml does"
            )
    return compiled_relations(actuator, calibration.channels, has_encoder)


@lru_cache(maxsize=8)
def described(actuator: str) -> Actuator:
    """Actuator of a description; cached, for a start needs it several times."""
    return read_actuator(load_yaml(actuator), actuator)


@lru_cache(maxsize=8)
def compiled_relations(
    actuator: str, channels: tuple[str, ...] | None = None, has_encoder: bool = True
) -> RelationSet:
    """Relations of the description that these channels close, of all its sensors by default.

    The speed comes from the encoder, or without one whose lead is known from the position.
    """
    model = described(actuator)
    known = [name for name in model.sensors if channels is None or name in channels]
    fitted = [name for name in known if has_encoder or name != "motor_speed"]
    held = [entry.name for entry in fields(ActuatorParameters)]
    return relation_set(model.with_sensors(fitted), RELATIONS, held, UNIT_PARAMETERS)


@lru_cache(maxsize=8)
def _signatures(
    actuator: str, faults: str, channels: tuple[str, ...], period_s: float
) -> tuple[str, Mapping[str, Fault], Mapping[Quadrant, SignatureTable]]:
    """Name of the actuator, catalogue and signature tables; cached, takes about 1 s."""
    whole = described(actuator)
    model = whole.with_sensors([name for name in channels if name in whole.sensors])
    rows = catalogue(load_yaml(faults), model, faults)
    names = tuple(name for name, spec in model.residuals.items() if spec.signs)
    tables = {
        quadrant: signature_table(model, rows, names, quadrant, period_s) for quadrant in QUADRANTS
    }
    return whole.name, MappingProxyType(rows), MappingProxyType(tables)


# --- stages -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Files:
    """Configuration files of the diagnosis; an empty name is the shipped file."""

    calibration: str = parameter(
        "", "calibration file; empty: that of the simulated stand", read_only=True
    )
    actuator: str = parameter("actuator.yaml", "actuator description file", read_only=True)
    faults: str = parameter("faults.yaml", "fault catalogue file", read_only=True)
    features: str = parameter("feature_table.yaml", "fault feature table file", read_only=True)


@dataclass(frozen=True)
class Memory:
    """State file from which a restarted one-process diagnosis resumes."""

    memory: str = parameter(
        "",
        "file that stores the verdict for a restart during a run; empty: one per domain and node "
        "below the user's state folder; none: no file",
        read_only=True,
    )


def file_texts(files: Files) -> dict[str, str]:
    """Name of each configuration file of the diagnosis -> its text, to be stored in a recording.

    Raises
    ------
    ConfigurationError
        A file does not exist, cannot be read or is too large.
    """
    named = {"calibration": files.calibration or CALIBRATION}
    named |= {name: getattr(files, name) for name in ("actuator", "faults", "features")}
    return {f"{name}.yaml": _text(found_file(where)) for name, where in named.items()}


P = TypeVar("P")


def _joined(name: str, *parts: type) -> type:
    """One parameter class with the fields of several."""
    entries = [(entry.name, entry.type, entry) for part in parts for entry in fields(part)]
    return make_dataclass(name, [(n, t, _copied(e)) for n, t, e in entries], frozen=True)


def _copied(entry: Any) -> Any:
    return parameter(entry.default, **entry.metadata)


def _part(kind: type[P], values: Any) -> P:
    names = {entry.name for entry in fields(kind)}  # type: ignore[arg-type]
    given: Mapping[str, Any] = {k: v for k, v in asdict(values).items() if k in names}
    return kind(**given)


def _unheard(_name: str) -> None:
    """Nobody asked for the progress."""


@dataclass(frozen=True)
class Component(Generic[P]):
    """Builds a stage from one frozen parameter object."""

    parameters: type
    make: Any

    def build(self, parameters: Any) -> Stage:
        """Fresh stage with these parameters."""
        stage: Stage = self.make(parameters)
        return stage

    def described(self, parameters: Any) -> str:
        """Which files, by name and content, a stage of these parameters rests on."""
        calibration = load_calibration(parameters.calibration)
        return (
            f"calibration {parameters.calibration or CALIBRATION} of actuator "
            f"{calibration.actuator} (sha256 {calibration_sha256(calibration)[:12]}), "
            f"{parameters.actuator}, {parameters.faults}, {parameters.features}"
        )

    def check(self, parameters: Any) -> None:
        """Refuse files from which no stage can be built; quick, for it builds none.

        Raises
        ------
        FleaError
            Names the file or parameter, its value and the remedy.
        """
        calibration = load_calibration(parameters.calibration)
        model = described(parameters.actuator)
        require_actuator(calibration, model.name, parameters.actuator)
        relations(calibration, parameters.actuator)
        catalogue(load_yaml(parameters.faults), model, parameters.faults)
        load_features(parameters.features)

    def warm_up(self, parameters: Any, begun: Callable[[str], None] = _unheard) -> None:
        """Run scans and features through a throw-away stage, to compile and load its code.

        ``begun`` is called with the name of each function whose compilation begins.

        Otherwise the first scan is delayed by this, by up to a minute if nothing is compiled yet,
        later scans are lost, and the first answer to a feature request is late.
        """
        with compiling(begun):
            self._warmed(parameters)

    def _warmed(self, parameters: Any) -> None:
        stage = self.make(parameters)
        if Scan not in stage.consumes:
            return
        if VibrationBlock in stage.consumes:
            table = load_features(parameters.features)
            try_out(table.features, table.nominal.rate_hz)
        calibration = load_calibration(parameters.calibration)
        channels, period_ns = calibration.channels, round(calibration.period_s * 1e9)
        for number in range(WARM_UP_SCANS):
            values = tuple(1e-3 * number * column for column in range(1, len(channels) + 1))
            stage.handle(Scan((1 + number) * period_ns, channels, values))


def _observer(values: Any) -> ObserverStage:
    calibration = load_calibration(values.calibration)
    known = relations(calibration, values.actuator)
    return ObserverStage(calibration, known, _part(ObserverParameters, values))


def _isolator(values: Any) -> IsolatorStage:
    known = knowledge(
        load_calibration(values.calibration), values.actuator, values.faults, values.features
    )
    return IsolatorStage(known, _part(IsolatorParameters, values))


def _extractor(values: Any) -> ExtractorStage:
    import time

    return ExtractorStage(
        load_features(values.features), _part(ExtractorParameters, values), time.perf_counter_ns
    )


def _diagnoser(values: Any) -> Pipeline:
    return Pipeline((_observer(values), _isolator(values), _extractor(values)))


OBSERVER: Component[Any] = Component(_joined("Observer", Files, ObserverParameters), _observer)
ISOLATOR: Component[Any] = Component(_joined("Isolator", Files, IsolatorParameters), _isolator)
EXTRACTOR: Component[Any] = Component(_joined("Extractor", Files, ExtractorParameters), _extractor)
DIAGNOSER: Component[Any] = Component(
    _joined(
        "Diagnoser",
        Files,
        Memory,
        ObserverParameters,
        IsolatorParameters,
        *(
            make_dataclass(
                "_Extractor",
                [
                    (e.name, e.type, _copied(e))
                    for e in fields(ExtractorParameters)
                    if e.name not in {f.name for f in fields(IsolatorParameters)}
                ],
                frozen=True,
            ),
        ),
    ),
    _diagnoser,
)


def make_pipeline(calibration: Path | None, source: str = "replay", **given: Any) -> Pipeline:
    """The three stages as a pipeline, for a replay without ROS; ``given`` are their parameters."""
    values = DIAGNOSER.parameters(calibration=str(calibration or ""), source=source, **given)
    pipeline = DIAGNOSER.build(values)
    assert isinstance(pipeline, Pipeline)
    return pipeline


# --- what screens draw --------------------------------------------------------------------


@lru_cache(maxsize=8)
def load_causal_map(actuator: str = "actuator.yaml") -> CausalMap:
    """Causal graph of an actuator with its layout, for a screen."""
    return causal_map(described(actuator))


def tree_planner(features: str = "feature_table.yaml", strategy: str = "optimal") -> Planner:
    """Function that plans the diagnosis tree of a group, given the features requested so far."""
    chooser = FeatureChooser(load_features(features).of_vibration(), strategy)
    return partial(asked_tree, chooser=chooser)
