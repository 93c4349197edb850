"""State observers, Kalman and particle filter, and their innovations."""
