"""Quantitative fault models, likelihood ratios with BIC, the baseline of a unit."""
