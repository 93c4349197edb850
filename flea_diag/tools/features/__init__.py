"""``flea features``: measure, learn, judge and study vibration features."""
