"""Which channels of a stand the balance of power is made of, by their units."""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.tools.recordings.power_balance import CURRENT, LOAD, POSITION, SPEED, VOLTAGE

UNITS: Mapping[str, tuple[str, ...]] = {
    CURRENT: ("A",),
    VOLTAGE: ("V",),
    POSITION: ("m", "rad"),
    SPEED: ("rad/s", "m/s"),
    LOAD: ("N", "N*m"),
}
COMMANDED = "commanded_"


def roles_of(units: Mapping[str, str]) -> dict[str, str]:
    """Role -> channel, of channels with these SI units in the order of the description.

    A load that is only commanded stands for the measured one; other commands have no role.
    """
    found: dict[str, str] = {}
    for role, fitting in UNITS.items():
        names = [name for name, unit in units.items() if unit in fitting]
        measured = [name for name in names if not name.startswith(COMMANDED)]
        chosen = measured or (names if role == LOAD else [])
        if chosen:
            found[role] = chosen[0]
    return found
