"""Machines that are drawn at random, and all commands on them."""
