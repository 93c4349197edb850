"""Conversion of records to the bytes of standard messages and back."""
