"""Actuators that tests hold the code against: written for them alone."""
