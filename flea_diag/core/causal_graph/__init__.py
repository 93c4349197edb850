"""Temporal causal graph (TCG), operating quadrants, sign propagation backward and forward."""
