"""Sensor validation: what a sensor shows by itself, without a plant model."""
