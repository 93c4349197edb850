"""Thin rclpy adapters that put stages on the bus."""
