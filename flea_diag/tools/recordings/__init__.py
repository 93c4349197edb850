"""``flea import``, and fault injection and unit switches in real recordings."""
