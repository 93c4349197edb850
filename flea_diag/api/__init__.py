"""The Python interface, ``import flea_diag as fd``: one module for each public name or two."""
