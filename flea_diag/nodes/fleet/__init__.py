"""Many stands in one process: what they share, and what keeps each from the others."""
