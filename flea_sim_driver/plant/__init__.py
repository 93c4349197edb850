"""The physics: drive, screw, heat, structure, vibration, and how units differ."""
