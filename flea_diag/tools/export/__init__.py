"""``flea export``: recordings and diagnoses in the formats of other programs."""
