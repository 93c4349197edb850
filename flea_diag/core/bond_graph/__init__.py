"""From the bond graph through causality (SCAP) to the state equations of one actuator."""
