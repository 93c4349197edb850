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

"""Templates: kinds of actuators, each with the shipped stand whose description it takes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
import numpy.typing as npt

from flea_diag.configuration.description import described
from flea_diag.configuration.files import config_folders, load_yaml
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.power_balance import (
    CURRENT,
    LOAD,
    POSITION,
    is_supply_current,
    rate_of,
    smoothed,
)
from flea_diag.core.calibration.sign_check import COMMANDED, SUPPLIED, UNITS, roles_of
from flea_diag.core.residuals.parameters import LEAD
from flea_diag.core.symbolic.expression import evaluate
from flea_diag.errors import ConfigurationError, RecordingError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import one_of
from flea_diag.formats import migrated
from flea_diag.tools.series.series_words import CURRENT as CURRENT_WORD
from flea_diag.tools.series.series_words import EFFORT, TORQUE, words_of
from flea_diag.tools.stand_folder.behaviour import named_by_behaviour
from flea_diag.tools.stand_folder.channel_choice import (
    ChosenChannel,
    GivenChannel,
    chosen_channels,
)

if TYPE_CHECKING:
    from pathlib import Path

    from flea_diag.configuration.stand import Stand
    from flea_diag.core.bond_graph.actuator_model import Actuator
    from flea_diag.tools.series.reading_grid import ReadingGrid
    from flea_diag.tools.series.series_sum import SeriesSum

Array = npt.NDArray[np.float64]

FOLDER = "templates"
NO_LOAD_CELL = "no load is measured, so the command stands for it"
MOTOR, SUPPLY = "motor", "supply"


@dataclass(frozen=True)
class _TemplateFile:
    title: str
    stand: str
    needs: tuple[str, ...]
    current: Annotated[str, one_of(MOTOR, SUPPLY)] = MOTOR
    asked: bool = False


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
    asked
        Whether it is taken only where it is named: what parts it from others no recording tells.
    """

    name: str
    title: str
    stand: Stand
    needs: tuple[str, ...]
    current: str
    asked: bool = False

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
    def reads_supply(self) -> bool:
        """Whether a voltage of it is that of a supply, and none is that of the motor."""
        volts = [name for name, unit in self.units.items() if unit == "V"]
        return bool(volts) and all(name.startswith(SUPPLIED) for name in volts)

    @property
    def way_per_turn(self) -> float:
        """Way of the moved part, m or rad, for each rad of the motor; 0 where no channel says."""
        ratio = self.model.base_parameters.get(LEAD)
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
    stand = load_stand(known.stand)
    return Template(name, known.title, stand, known.needs, known.current, known.asked)


@dataclass(frozen=True)
class TemplateFit:
    """A template with its channels; ``rivals`` are templates that fit as well."""

    template: Template
    channels: tuple[ChosenChannel, ...]
    rivals: tuple[str, ...] = ()


def fitting_template(
    grid: ReadingGrid, wanted: str, given: Mapping[str, GivenChannel]
) -> TemplateFit:
    """The template that most of a recording fits, with its channels; or the one wanted.

    ``given`` are channels whose sources are known.

    Raises
    ------
    RecordingError
        Nothing in the recording is a channel that a template needs.
    """
    sources = named_by_behaviour(grid.sources, grid.period_s)
    known = [template(name) for name in ([wanted] if wanted else template_files())]
    known = [each for each in known if wanted or not each.asked]
    _check_given(grid, sources, known, given)
    fits = [(each, chosen_channels(sources, each.units, given)) for each in known]
    usable = [
        (each, found) for each, found in fits if _is_of(each, found, grid.period_s, bool(wanted))
    ]
    if usable:
        merits = [_merit(each, found) + _of_a_joint(grid, each, found) for each, found in usable]
        best = int(np.argmax(merits))
        kind, found = usable[best]
        rivals = tuple(
            usable[k][0].name
            for k, merit in enumerate(merits)
            if k != best and merit > merits[best] - EQUAL
        )
        return TemplateFit(kind, with_commanded_load(kind, found), rivals)
    nearest, found = max(fits, key=lambda row: _merit(*row))
    missing = [name for name in nearest.needs if name not in {each.channel for each in found}]
    raise RecordingError(_no_template(grid, nearest, missing, wanted))


EQUAL = 0.05
"""Difference in merit up to which two templates fit equally."""
JOINT = 0.3
"""Merit of a turning part where words or types say that it is a joint."""
_JOINTS = frozenset({"joint", "joints", "elbow", "shoulder", "wrist", "hip", "knee", "ankle", "q",
                     "qd", "dq"})  # fmt: skip


def _merit(_: Template, found: Sequence[ChosenChannel]) -> float:
    """Merit of all channels; where names tell some, what a series follows tells no kind."""
    named = [each for each in found if not each.source.because]
    return sum(channel.merit for channel in named or found)


def _of_a_joint(grid: ReadingGrid, kind: Template, found: Sequence[ChosenChannel]) -> float:
    if kind.units.get("actuator_position") != "rad":
        return 0.0
    names = [each.words for each in grid.recorded.series]
    words = {w for name in names for w in re.findall(r"[a-z]+", name.lower())}
    typed = any(each.source.words.typed == "rad" for each in found)
    torque = any(each.source.words.quantity in (TORQUE, EFFORT) for each in found)
    return JOINT if typed or torque or words & _JOINTS else 0.0


def _check_given(
    grid: ReadingGrid,
    sources: Sequence[SeriesSum],
    known: Sequence[Template],
    given: Mapping[str, GivenChannel],
) -> None:
    channels = {name for each in known for name in each.units}
    names = {n for each in sources for n in (each.name, each.terms[0][0].words)}
    for channel, own in given.items():
        if channel not in channels:
            raise ConfigurationError(
                f"--channel {channel}: no channel of {' or '.join(k.name for k in known)}, which "
                f"have {', '.join(sorted(channels))}"
            )
        if own.source not in names:
            reason = dict(grid.unused).get(own.source, "")
            raise ConfigurationError(
                f"--channel {channel}={own.source}: "
                + (f"that is not usable: {reason}" if reason else
                   f"the recording has no {shown(own.source)}, it has "
                   f"{', '.join(sorted(names)[:12])}")
            )  # fmt: skip


def _no_template(grid: ReadingGrid, kind: Template, missing: Sequence[str], wanted: str) -> str:
    """Why a recording is of no template: what is missing, and what became of it."""
    path = grid.recorded.path
    if not missing:
        return (
            f"{path}: a current that never turns with the direction, as of a supply, is of no "
            f"template that this recording has the channels of; name one, --template {kind.name}"
        )
    has = ", ".join(each.name for each in grid.sources[:12]) or "nothing"
    lost = [
        f"{name} is {reason}" if reason in ("constant", "empty") else f"{name}: {reason}"
        for name, reason in grid.unused
        if _would_be(name, missing) and "another joint" not in reason
    ]
    why = f" ({'; '.join(lost[:3])})" if lost else ""
    asked = "" if wanted else " or another --template"
    return (
        f"{path}: no {' and no '.join(missing)} for {kind.name} among {has}{why}; record it, name "
        "the columns or topics after what they hold (current, position, speed, load), or say "
        f"which it is: --channel {missing[0]}=NAME{asked}"
    )


def _would_be(name: str, missing: Sequence[str]) -> bool:
    quantity = words_of(name).quantity
    wanted = {words_of(each).quantity for each in missing}
    return quantity in wanted or (quantity in (EFFORT, TORQUE) and CURRENT_WORD in wanted)


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
    if not _moves_both_ways(values[roles[POSITION]], period_s):
        return None
    return is_supply_current(values[roles[CURRENT]], values[roles[POSITION]], period_s)


BOTH_WAYS = 0.02
"""Share of the time that a part moves either way, in a recording that tells signs."""


def _moves_both_ways(position: Array, period_s: float) -> bool:
    speed = rate_of(smoothed(position, period_s), period_s)
    speed = speed[np.isfinite(speed)]
    if not len(speed):
        return False
    most = 0.1 * float(np.abs(speed).max())
    return min(float(np.mean(speed > most)), float(np.mean(speed < -most))) > BOTH_WAYS
