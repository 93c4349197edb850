"""Drawings of the graphs: DOT text and layouts."""
