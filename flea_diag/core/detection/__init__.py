"""Detection tests: windowed Z-test, mean-shift test, symbols."""
