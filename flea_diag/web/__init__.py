"""The operator page: records in, HTML and SVG out, served to a browser. No ROS.

The panels are pure functions of the state that ``flea_diag.operator`` folds from records;
``pages`` puts them on NiceGUI pages, ``server`` serves it, ``guard`` controls the access.
"""
