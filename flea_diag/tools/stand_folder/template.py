"""Templates: kinds of actuators, each with the shipped stand whose description it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated

from flea_diag.configuration.description import described
from flea_diag.configuration.files import config_folders, load_yaml
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.power_balance import CURRENT, LOAD, POSITION, is_supply_current
from flea_diag.core.calibration.sign_check import COMMANDED, UNITS, roles_of
from flea_diag.core.symbolic.expression import evaluate
from flea_diag.errors import ConfigurationError, RecordingError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import one_of
from flea_diag.formats import migrated
from flea_diag.tools.stand_folder.behaviour import named_by_behaviour
from flea_diag.tools.stand_folder.channel_choice import ChosenChannel, chosen_channels

if TYPE_CHECKING:
    from pathlib import Path

    from flea_diag.configuration.stand import Stand
    from flea_diag.core.bond_graph.actuator_model import Actuator
    from flea_diag.tools.stand_folder.reading_grid import ReadingGrid

FOLDER = "templates"
NO_LOAD_CELL = "no load is measured, so the command stands for it"
MOTOR, SUPPLY = "motor", "supply"


@dataclass(frozen=True)
class _TemplateFile:
    title: str
    stand: str
    needs: tuple[str, ...]
    current: Annotated[str, one_of(MOTOR, SUPPLY)] = MOTOR


@dataclass(frozen=True)
class Template:
    """One kind of actuator.

    Parameters
    ----------
    name
        For ``--template``.
    title
        For people.
    stand
        The shipped stand whose description, fault catalogue and feature table it takes.
    needs
        Channels without which it is not this kind.
    current
        Whether ``motor_current`` is that of the motor or of the supply of its drive.
    """

    name: str
    title: str
    stand: Stand
    needs: tuple[str, ...]
    current: str

    @cached_property
    def model(self) -> Actuator:
        """The description."""
        return described(self.stand.actuator)

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each channel, sensors first."""
        model = self.model
        return {**{name: s.unit for name, s in model.sensors.items() if s.at}, **model.units}

    @property
    def way_per_turn(self) -> float:
        """Way of the moved part, m or rad, for each rad of the motor; 0 where no channel says."""
        ratio = self.model.base_parameters.get("encoder_m_per_rad")
        return 0.0 if ratio is None else float(evaluate(ratio, self.model.graph.values()))


@lru_cache(maxsize=1)
def template_files() -> dict[str, Path]:
    """Name of each template -> its file."""
    found: dict[str, Path] = {}
    for folder in config_folders():
        for path in sorted(folder.glob(f"{FOLDER}/*.yaml")):
            found.setdefault(path.stem, path)
    return found


def template(name: str) -> Template:
    """A template by its name.

    Raises
    ------
    ConfigurationError
        There is none of this name, or it is refused.
    """
    files = template_files()
    if name not in files:
        raise ConfigurationError(
            f"template {shown(name)} is not shipped, known are {', '.join(files) or 'none'}"
        )
    where = str(files[name])
    known = read_as(_TemplateFile, migrated("stand template", load_yaml(files[name]), where), where)
    return Template(name, known.title, load_stand(known.stand), known.needs, known.current)


def fitting_template(grid: ReadingGrid, wanted: str) -> tuple[Template, tuple[ChosenChannel, ...]]:
    """The template that most of a recording fits, with its channels; or the one wanted.

    Raises
    ------
    RecordingError
        Nothing in the recording is a channel that a template needs.
    """
    sources = named_by_behaviour(grid.sources, grid.period_s)
    known = [template(name) for name in ([wanted] if wanted else template_files())]
    fits = [(each, chosen_channels(sources, each.units)) for each in known]
    usable = [
        (each, found) for each, found in fits if _is_of(each, found, grid.period_s, bool(wanted))
    ]
    if usable:
        kind, found = max(usable, key=lambda row: sum(channel.merit for channel in row[1]))
        return kind, with_commanded_load(kind, found)
    best, found = max(fits, key=lambda row: sum(channel.merit for channel in row[1]))
    missing = [name for name in best.needs if name not in {each.channel for each in found}]
    has = ", ".join(each.name for each in grid.sources[:12])
    raise RecordingError(
        f"{grid.recorded.path}: no {' and no '.join(missing)} for {best.name} among {has}; name "
        "the columns or topics after what they hold (current, position, speed, load)"
    )


def with_commanded_load(
    kind: Template, found: tuple[ChosenChannel, ...]
) -> tuple[ChosenChannel, ...]:
    """The command in place of a load that the description measures and the recording lacks."""
    recorded = {each.channel for each in found}
    sensors = {name: s.unit for name, s in kind.model.sensors.items() if s.unit in UNITS[LOAD]}
    if recorded & sensors.keys():
        return found
    places = {unit: name for name, unit in sensors.items()}
    return tuple(
        replace(each, channel=places[each.si_unit], merit=0.0, because=NO_LOAD_CELL)
        if each.channel.startswith(COMMANDED) and each.si_unit in places
        else each
        for each in found
    )


def _is_of(kind: Template, found: Sequence[ChosenChannel], period_s: float, wanted: bool) -> bool:
    channels = {each.channel: each for each in found}
    if not set(kind.needs) <= channels.keys():
        return False
    return bool(wanted) or has_supply_current(found, period_s) in (None, kind.current == SUPPLY)


def has_supply_current(found: Sequence[ChosenChannel], period_s: float) -> bool | None:
    """Whether the current is that of a supply; None without a current and a position."""
    roles = roles_of({each.channel: each.si_unit for each in found})
    values = {each.channel: each.source.values for each in found}
    if not {CURRENT, POSITION} <= roles.keys():
        return None
    return is_supply_current(values[roles[CURRENT]], values[roles[POSITION]], period_s)
