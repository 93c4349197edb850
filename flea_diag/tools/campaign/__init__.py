"""Campaigns: which runs there are, their records, and the results that are kept."""
