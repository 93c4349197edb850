"""Scores, reports and ``flea diff``."""
