"""The ``flea`` command: works on bags, without ROS."""
