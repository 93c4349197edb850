"""The errors of flea_diag: every one names the thing, the value, the limit and the remedy.

FleaError
├── InputError            what somebody else wrote (a file, a bag, a message) cannot be used
│   ├── RecordingError    a .data file or a bag: names file and place
│   ├── ConfigurationError  a YAML file, a parameter or a command-line argument
│   ├── CalibrationError  a calibration that does not fit, or runs that cannot calibrate
│   └── WireError         a message that does not hold the record its topic promises
└── ModelError            a bond graph that has no sound causality or equations

Every command turns a ``FleaError`` into one line on standard error and exit status 2;
anything else is a defect of ours and keeps its traceback.
"""


class FleaError(Exception):
    """Base of all errors that flea_diag raises on purpose."""


class InputError(FleaError):
    """Something written by somebody else cannot be used as it is."""


class RecordingError(InputError):
    """A recording (.data file or bag) is truncated, foreign or inconsistent."""


class ConfigurationError(InputError):
    """A configuration file, a parameter or an argument is out of its limits."""


class CalibrationError(InputError):
    """A calibration does not fit the actuator, or the runs given cannot calibrate it."""


class WireError(InputError):
    """A message on the wire does not hold the record that its topic promises."""


class ModelError(FleaError):
    """A bond graph has no sound causality, or its equations cannot be formed."""
