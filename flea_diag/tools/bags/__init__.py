"""``flea bag`` and ``flea recover``: whether bags are sound, and mending them."""
