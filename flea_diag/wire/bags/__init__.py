"""Bags in rosbag2's MCAP layout, read and written without ROS."""
