# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""flea_diag: hybrid fault diagnosis of electro-mechanical actuators on a test stand.

    import flea_diag as fd

    run = fd.open("bags/jam")       # a bag, a recording of your own, or a URL
    result = fd.diagnose(run)       # or a data frame, or arrays
    result.plot()

The names below are the whole of the Python interface. Each is loaded when it is first used, so
the import itself takes milliseconds.
"""

import importlib
from typing import Any

__version__ = "0.1.0"

_PLACES = {
    "open": ("opening", "open_recording"),
    "open_liu_ice": ("liu_ice", "open_liu_ice"),
    "Recording": ("recording", "Recording"),
    "Table": ("table", "Table"),
    "Stand": ("stand", "StandFolder"),
    "calibrate": ("calibrated", "calibrate"),
    "Calibrated": ("calibrated", "Calibrated"),
    "diagnose": ("diagnose", "diagnose"),
    "Diagnosis": ("diagnosis", "Diagnosis"),
    "EpisodeResult": ("diagnosis", "EpisodeResult"),
    "PossibleFault": ("diagnosis", "PossibleFault"),
    "Stream": ("stream", "Stream"),
    "simulate": ("simulate", "simulate"),
    "FleaError": ("", "FleaError"),
}
"""Public name -> module of ``flea_diag.api`` and the name there; types are in ``__init__.pyi``."""

__all__ = ["__version__", *_PLACES]


def __getattr__(name: str) -> Any:
    """A public name, from the module that defines it (PEP 562)."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, there = _PLACES[name]
    place = f"{__name__}.api.{module}" if module else f"{__name__}.errors"
    found = getattr(importlib.import_module(place), there)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The public names, for completion in a shell or notebook."""
    return sorted(__all__)
