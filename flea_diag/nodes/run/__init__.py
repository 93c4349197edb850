"""Live run of ``scripts/run``: its processes, their ROS domain, the final summary."""
