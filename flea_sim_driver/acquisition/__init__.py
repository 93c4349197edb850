"""From physical quantities to what a DAQ sends, and to a bag."""
