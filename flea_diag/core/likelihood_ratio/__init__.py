"""Generalized likelihood ratios over faults and onsets, beside a unit and a drifting level."""
