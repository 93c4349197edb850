"""Diagnosis algorithms: no ROS, no files, no clock, no global randomness."""
