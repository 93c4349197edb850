"""The ``flea`` command line: tools for bags, calibrations and campaigns, without ROS."""
