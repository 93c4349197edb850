"""Comparison of simulated runs with real ones."""
