"""The temporal causal graph, its quadrants, and signs propagated backward and forward."""
