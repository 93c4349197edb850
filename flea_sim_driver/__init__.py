"""The simulated stand and its DAQ node. Shares nothing with the diagnoser but the wire."""
