"""What concerns a whole shift: which alarms are shown, how fast they came, the report."""
