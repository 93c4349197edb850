"""A whole graph of nodes in one seeded scheduler: bus, clock, disk and the arrival of messages."""
