"""``flea calibrate``: parameters and limits from nominal recordings."""
