"""The errors of flea_diag; each message names the item, its value, the limit and the remedy.

FleaError
├── InputError            invalid input (a file, a bag, a message)
│   ├── RecordingError    a .data file or a bag; names file and position
│   ├── ConfigurationError  a YAML file, a parameter or a command-line argument
│   ├── CalibrationError  a calibration that does not fit, or runs unsuitable for calibration
│   └── WireError         a message without a valid record of its topic
└── ModelError            a bond graph without valid causality or equations

Every command reports a ``FleaError`` as one line on standard error, with exit status 2; any other
exception is a defect of flea_diag and keeps its traceback.
"""


class FleaError(Exception):
    """Base class of all errors raised intentionally by flea_diag."""


class InputError(FleaError):
    """Input is invalid."""


class RecordingError(InputError):
    """A recording (.data file or bag) is truncated, of another format, or inconsistent."""


class ConfigurationError(InputError):
    """A configuration file, a parameter or an argument is invalid or outside its limits."""


class CalibrationError(InputError):
    """A calibration does not fit the actuator, or the runs are unsuitable for calibration."""


class WireError(InputError):
    """A message does not contain a valid record of its topic."""


class ModelError(FleaError):
    """A bond graph has no valid causality, or its equations cannot be formed."""
