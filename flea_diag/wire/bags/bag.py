"""Bags: recordings of the topics in rosbag2's MCAP layout, written and read without ROS."""

from flea_diag.wire.bags.bag_reader import BagReader, read_bag
from flea_diag.wire.bags.bag_writer import BagSplit, BagWriter

__all__ = ["BagReader", "BagSplit", "BagWriter", "read_bag"]
