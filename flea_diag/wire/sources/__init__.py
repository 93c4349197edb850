"""Channels of a stand from topics and tables of any make: one mapping, live and recorded."""
