"""``flea stand check``: what recordings of a stand are good for."""
