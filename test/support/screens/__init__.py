"""Screens under test, on records of the test."""
