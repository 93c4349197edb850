"""A stage on the bus: what a live graph needs besides the decisions of the stage."""
