"""Interfaces between processes: records, their messages, topics, bags, and the ROS bus."""
