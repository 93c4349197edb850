"""``flea simulate``, ``scenarios`` and ``realism``: the simulated stand without ROS."""
