"""Recordings as series of numbers: what is in them, whose it is, and on which times."""
