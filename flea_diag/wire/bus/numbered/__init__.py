"""What the numbers that writers give their messages tell: losses, and a second writer."""
