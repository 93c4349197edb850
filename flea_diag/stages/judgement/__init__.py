"""What the tests had to judge, and which faults were therefore not looked for."""
