"""Benches of the law of healthy recordings."""
