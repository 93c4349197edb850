"""Definition of a run: settings, motion, faults, schedules, the draws of Table 4."""
