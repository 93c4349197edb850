"""What a run is to be: settings, motion, faults, schedules, the draws of Table 4."""
