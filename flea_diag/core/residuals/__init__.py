"""Analytical redundancy relations: symbolic, numeric, scan by scan; how units vary."""
