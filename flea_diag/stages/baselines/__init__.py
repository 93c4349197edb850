"""Other ways to diagnose, to compare with."""
