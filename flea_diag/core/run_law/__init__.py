"""One law of healthy recordings, learned from all of them: what they differ by, and their noise."""
