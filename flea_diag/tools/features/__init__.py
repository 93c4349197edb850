"""``flea features``: vibration features and fault feature tables: list, learn, score, study."""
