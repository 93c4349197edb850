"""``flea bag`` and ``flea recover``: checking and recovering bags."""
