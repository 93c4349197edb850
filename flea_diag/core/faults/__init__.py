"""The fault catalogue, and what one signature is."""
