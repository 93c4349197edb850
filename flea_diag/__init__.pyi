from flea_diag.api.calibrated import Calibrated, calibrate
from flea_diag.api.diagnose import diagnose
from flea_diag.api.diagnosis import Diagnosis, EpisodeResult, PossibleFault
from flea_diag.api.liu_ice import open_liu_ice
from flea_diag.api.opening import open_recording as open
from flea_diag.api.recording import Recording
from flea_diag.api.simulate import simulate
from flea_diag.api.stand import StandFolder as Stand
from flea_diag.api.stream import Stream
from flea_diag.api.table import Table
from flea_diag.errors import FleaError

__version__: str
__all__ = [
    "Calibrated",
    "Diagnosis",
    "EpisodeResult",
    "FleaError",
    "PossibleFault",
    "Recording",
    "Stand",
    "Stream",
    "Table",
    "__version__",
    "calibrate",
    "diagnose",
    "open",
    "open_liu_ice",
    "simulate",
]
