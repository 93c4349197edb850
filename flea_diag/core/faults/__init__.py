"""Fault catalogue and fault signatures."""
