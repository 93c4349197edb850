"""Recorder node, and the episode clips that it writes."""
