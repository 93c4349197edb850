"""Simulated runs held against real ones."""
