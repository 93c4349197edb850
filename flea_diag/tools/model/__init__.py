"""``flea model``: bond graph, equations, signatures and diagnosability of an actuator."""
