"""Stores vibration as received and computes single features on request."""
