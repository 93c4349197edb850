"""Stand-ins for other packages of ROS, and messages on their way through a node of ours."""
