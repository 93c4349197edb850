"""One ament_python package for pip and for colcon; metadata is in setup.cfg.

What ``ros2`` looks for goes out as data files: the resource index marker, package.xml, the
launch and configuration files, and one launcher per node in lib/flea_diag. pip ignores the
``install_scripts`` of the usual template, so entry points cannot serve ``ros2 run``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from setuptools import setup

PACKAGE = "flea_diag"
SHARE = f"share/{PACKAGE}"


def folders(root: str) -> list[tuple[str, list[str]]]:
    """Every folder below ``root`` with its files, installed under share/flea_diag."""
    found: dict[str, list[str]] = {}
    for path in sorted(Path(root).rglob("*")):
        if path.is_file() and path.suffix != ".pyc":
            found.setdefault(f"{SHARE}/{path.parent.as_posix()}", []).append(path.as_posix())
    return sorted(found.items())


# colcon asks with --dry-run and reads the arguments of setup() back as Python literals, which a
# version specifier is not.
requires = {} if "--dry-run" in sys.argv else {"python_requires": ">=3.10"}

setup(
    **requires,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (SHARE, ["package.xml"]),
        (f"lib/{PACKAGE}", sorted(str(path) for path in Path("launcher").iterdir())),
        *folders("launch"),
        *folders("config"),
    ],
)
