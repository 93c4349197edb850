"""From symbols, residuals and features to the ambiguity group."""
