"""A disk that fails, and what commands leave on it."""
