"""Machines that nobody tuned on: a plant of its own, drawn parameters, and what became of them."""
