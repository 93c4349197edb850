"""``flea model``: an actuator's graph, equations, signatures and diagnosability."""
