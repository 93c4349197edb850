"""Conditions under which relations do not hold although nothing is faulty."""
