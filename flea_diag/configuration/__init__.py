"""Finds and reads the files of a stand, and builds its stages for nodes and tools."""
