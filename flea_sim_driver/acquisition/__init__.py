"""From physical quantities to the records of a DAQ, and to a bag."""
