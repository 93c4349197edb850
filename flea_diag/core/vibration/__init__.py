"""Windows of vibration, condition indicators, nominal ranges, the always-on monitor."""
