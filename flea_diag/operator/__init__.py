"""Content of the operator screens: a state folded from records, alarms, text panels.

Pure: records in, frozen values out; no ROS, no files, no clock. All screens (lines, console, web
page) render the same `OperatorState` and show nothing that is not in the records.
"""
