"""Limits of every test from nominal recordings, and how near these come to them out of sample."""
