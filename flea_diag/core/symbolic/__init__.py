"""Symbolic algebra and SI units."""
