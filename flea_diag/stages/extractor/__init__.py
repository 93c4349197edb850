"""Vibration kept as it came, and single features on request."""
