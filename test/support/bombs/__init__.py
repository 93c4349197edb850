"""Well-formed bombs: input that every parser accepts and that is enormous, wrong or changing."""
