"""DOT and layouts of the graphs."""
