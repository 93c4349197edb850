"""Records to the bytes of standard messages and back."""
