"""Recordings of other makes."""
