"""Fault signature matrix (initial, sampled, parity) and diagnosability."""
