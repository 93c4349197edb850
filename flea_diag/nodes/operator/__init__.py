"""Operator nodes: console, web page, and the alarm journal that they share."""
