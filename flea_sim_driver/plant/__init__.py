"""The physics: drive, screw, heat, structure, vibration and unit variability."""
