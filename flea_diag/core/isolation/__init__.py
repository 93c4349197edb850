"""Hypotheses refined by symbols and likelihood; detectability."""
