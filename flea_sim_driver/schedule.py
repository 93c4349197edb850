"""When each fault acts and how strongly: onset, growth, intermittence, clearing."""

from __future__ import annotations

from dataclasses import dataclass, replace

from flea_sim_driver.faults import CATALOGUE, Fault
from flea_sim_driver.scenario import FaultSetting, Switch

GRID_S = 0.01
"""Onsets are moved onto the scan grid, so that the truth is exact and no scan is mixed."""


@dataclass(frozen=True)
class Episode:
    """One fault at work from ``onset_s`` to ``end_s``, seconds after the start of the run."""

    setting: FaultSetting
    onset_s: float
    end_s: float = float("inf")

    @property
    def row(self) -> Fault:
        """Its row of the catalogue."""
        return CATALOGUE[self.setting.fault]

    def size_at(self, time_s: float, unit: str) -> float | None:
        """Size at a time on a unit, None while it is absent."""
        if not self.onset_s <= time_s < self.end_s or self.setting.unit not in ("", unit):
            return None
        age = time_s - self.onset_s
        cycle = self.setting.on_s + self.setting.off_s
        if cycle > 0.0 and (age + 1e-9) % cycle >= self.setting.on_s:
            return None
        return self._grown(age)

    def _grown(self, age: float) -> float:
        if self.setting.growth_s <= 0.0 or age >= self.setting.growth_s:
            return self.setting.size
        rest = 1.0 if self.row.mode == "scaling" else 0.0
        return rest + (self.setting.size - rest) * age / self.setting.growth_s


def on_grid(time_s: float) -> float:
    """The scan instant nearest to a time."""
    return round(time_s / GRID_S) * GRID_S


def episodes(settings: tuple[FaultSetting, ...], switch: Switch, start: str) -> tuple[Episode, ...]:
    """Episodes of a scenario; a fault of a unit that is switched in later begins then."""
    return tuple(_episode(setting, switch, start) for setting in settings)


def _episode(setting: FaultSetting, switch: Switch, start: str) -> Episode:
    onset = setting.onset_s
    if setting.unit not in ("", start) and switch.at_s >= 0.0 and setting.unit == switch.to:
        onset = max(onset, switch.at_s)
    return Episode(setting, on_grid(onset))


def cleared(episode: Episode, time_s: float) -> Episode:
    """The episode ended at ``time_s`` where it is still at work."""
    return replace(episode, end_s=min(episode.end_s, time_s))
