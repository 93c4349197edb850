"""Order, losses and rate of a stream of scans, by its stamps."""
