from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.sensors.stale_rows import StaleRows

NAN = float("nan")


@pytest.mark.parametrize("cuts", [(), (3,), (1, 2, 3, 4, 5, 6)])
def test_a_row_that_repeats_the_one_before_in_all_that_reads_is_stale(cuts: tuple[int, ...]):
    rows = np.array(
        [
            [1.0, 2.0, 3.0, NAN],
            [1.0, 2.0, 3.0, NAN],  # again
            [1.0, 2.0, 3.5, NAN],  # two sensors hold, one moves
            [1.0, 2.0, 3.5, 4.0],  # one more reads
            [1.0, 2.0, 3.5, 4.0],  # again
            [1.0, 2.0, NAN, NAN],
            [1.0, 2.0, NAN, NAN],  # two may agree by chance
        ]
    )
    stale = StaleRows(4)
    parts = [(part, stale.find(part)) for part in np.split(rows, cuts)]
    found = [np.zeros(len(part), bool) if flags is None else flags for part, flags in parts]
    assert np.flatnonzero(np.concatenate(found)).tolist() == [1, 4]
