"""ROS nodes: adapters that connect stages to the bus, recorder, operator screens, live run."""
