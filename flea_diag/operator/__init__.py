"""What the people at the stand are told: a state folded from records, and alarms.

Pure: records in, frozen values out; no ROS, no file, no clock. Every screen (text, page, web)
renders the same `OperatorState`, so that none can say more than the records do.
"""
