"""``flea import``, and faults and switches put into real recordings."""
