"""Other nodes and their services, which may start and stop at any time."""
