"""``flea replay`` and ``flea trend``: bags through the diagnosis, without ROS."""
