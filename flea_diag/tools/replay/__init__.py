"""``flea replay`` and ``flea trend``: diagnosis of bags without ROS."""
