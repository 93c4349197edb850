"""What to do next, in words: tests that would split the group. Advice, never a command."""

from __future__ import annotations

from flea_diag.operator.panel import Line, Panel
from flea_diag.operator.state import OperatorState
from flea_diag.wire.records import NextTest, Outcome


def next_tests(state: OperatorState) -> Panel | None:
    """Tests that would split the group that is left, the most gained for each second first."""
    group = state.group
    if group is None or group.outcome is not Outcome.INDISTINGUISHABLE:
        return None
    if not group.next_tests:
        return Panel("next", "NEXT TEST  none is known that would split these faults")
    tests = group.next_tests
    if all(test.kind == "sensor" for test in tests):
        title = "NEXT TEST  by design none splits these faults with the sensors of this stand"
    else:
        title = f"NEXT TEST  advice; {len(group.members)} faults are left now"
    return Panel("next", title, tuple(Line(advice_text(test)) for test in tests))


def advice_text(test: NextTest) -> str:
    """One test, what it is expected to leave, and which faults it tells apart."""
    left = f"{test.expected_size:.1f} expected to be left"
    splits = ", ".join(test.splits)
    if test.kind == "sensor":
        return f"fit {test.what}: {left} then ({splits})"
    return f"{test.kind} {test.what}: {left} after {test.seconds:.0f} s ({splits})"
