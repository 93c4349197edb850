"""Detection and isolation by the evidence of one law."""
