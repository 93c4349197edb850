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

"""One ament_python package for pip and for colcon alike.

What ``ros2`` looks for goes out as data files: the resource index marker, package.xml, the
launch and configuration files, and one launcher per node in lib/flea_diag. pip ignores the
``install_scripts`` of the usual template, so entry points cannot serve ``ros2 run``.

All metadata stands here: colcon takes a setup.cfg that names the package for the whole of it,
and then knows of no data files.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

PACKAGE = "flea_diag"
SHARE = f"share/{PACKAGE}"

# ROS 2 comes as wheels, for Linux on x86-64 only; elsewhere, and in a ROS installation that
# provides rclpy itself, `pip install --no-deps` leaves them out. Both are pinned together:
# loose, pip mixes in packages of the next distribution.
ROS = {
    "jazzy": ("ros-rclpy[fastrtps]==7.1.6", "ros-jazzy-common-interfaces==5.3.6"),
    "kilted": ("ros-rclpy[fastrtps]==9.1.2", "ros-kilted-common-interfaces==5.5.1"),
}
DISTRIBUTION = os.environ.get("FLEA_DIAG_ROS", "jazzy")
"""Whose wheels are installed: `FLEA_DIAG_ROS=kilted pip install .` takes the next distribution."""
if DISTRIBUTION not in ROS:
    raise SystemExit(f"FLEA_DIAG_ROS={DISTRIBUTION} is unknown, choose one of {', '.join(ROS)}")
WHEELS = 'sys_platform == "linux" and platform_machine == "x86_64"'
REQUIRES = [
    "numpy>=1.26",
    "scipy>=1.11",
    "PyYAML>=6.0",
    "PyWavelets>=1.4",
    "mcap>=1.2",
    "rosbags>=0.10.4",
    "threadpoolctl>=3.1",
    *(f"{wheel}; {WHEELS}" for wheel in ROS[DISTRIBUTION]),
]
DOCS = [
    "mkdocs>=1.6,<2",
    "mkdocs-material>=9.7",
    "mkdocstrings[python]>=1.0",
    # Equations become MathML when the site is built: no script, no font, no network.
    "latex2mathml>=3.78",
]
EXTRAS = {
    "numba": ["numba>=0.60"],
    "console": ["textual>=8.0"],
    "plot": ["matplotlib>=3.7"],
    "classifier": ["scikit-learn>=1.3"],
    "evaluate": ["Jinja2>=3.1", "tqdm>=4.65"],
    "dask": ["distributed>=2024.1"],
    "parquet": ["pyarrow>=15"],
    "excel": ["openpyxl>=3.1"],
    "hdf5": ["h5py>=3.10"],
    "ulog": ["pyulog>=1.0"],
    # Data frames and datasets of the Python interface.
    "frames": ["pandas>=2.2", "xarray>=2024.1"],
    # Bags at https://; s3:// needs s3fs besides, others what fsspec asks for.
    "url": ["fsspec>=2024.1", "aiohttp>=3.9"],
    "completion": ["argcomplete>=3.0"],
    "web": ["nicegui>=3.0"],
    "docs": DOCS,
    # Coverage-guided fuzzing, by hand alone: scripts/fuzz --atheris.
    "fuzz": ["atheris>=3.0"],
    "test": [
        "pytest>=7.4",
        "pytest-xdist>=3.5",
        "pytest-cov>=7.0",
        "coverage>=7.10",
        "hypothesis>=6.100",
        "mypy>=1.11",
        "ruff>=0.9",
        "setuptools>=70.1",
        "colcon-common-extensions",
        "Jinja2>=3.1",
        "matplotlib>=3.7",
        "selenium>=4.20",
        "axe-core-python>=0.1",
        "scikit-learn>=1.3",
        # The structural oracle of the diagnosability tests; compiled, so where there is a wheel.
        f"faultdiagnosistoolbox>=0.12.5; {WHEELS}",
        "tqdm>=4.65",
        "distributed>=2024.1",
        "pandas>=2.2",
        "xarray>=2024.1",
        "pyarrow>=15",
        "argcomplete>=3.0",
        "pyod>=3.0",
        *DOCS,  # test/project/test_site.py builds the site
    ],
}


def version() -> str:
    """The version, from the one place in Python where it stands."""
    text = Path("flea_diag/__init__.py").read_text(encoding="utf-8")
    return re.search(r'^__version__ = "(.+)"$', text, re.MULTILINE)[1]


def folders(root: str) -> list[tuple[str, list[str]]]:
    """Every folder below ``root`` with its files, installed under share/flea_diag."""
    found: dict[str, list[str]] = {}
    for path in sorted(Path(root).rglob("*")):
        if path.is_file() and path.suffix != ".pyc":
            found.setdefault(f"{SHARE}/{path.parent.as_posix()}", []).append(path.as_posix())
    return sorted(found.items())


def readme() -> str:
    """The long description; a build with --symlink-install has no README beside it."""
    path = Path("README.md")
    return path.read_text(encoding="utf-8") if path.is_file() else ""


class BuildWithCommit(build_py):
    """The modules, and beside them the commit that they are built from, where git knows one."""

    def run(self) -> None:
        """Build, then note the commit for what is measured with the installed package."""
        super().run()
        if Path(".git").exists():
            command = ["git", "describe", "--always", "--dirty=+", "--abbrev=9", "--exclude=*"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            Path(self.build_lib, PACKAGE, "commit.txt").write_text(done.stdout, encoding="utf-8")


# colcon asks with --dry-run and reads the arguments of setup() back as Python literals, which a
# version specifier and a class are not.
PYTHON = (
    {}
    if "--dry-run" in sys.argv
    else {"python_requires": ">=3.10", "cmdclass": {"build_py": BuildWithCommit}}
)

setup(
    name=PACKAGE,
    version=version(),
    description="Hybrid fault diagnosis of electro-mechanical actuators on a test stand (ROS 2)",
    long_description=readme(),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    license_files=["LICENSE"],
    maintainer="flea_diag maintainers",
    maintainer_email="maintainers@flea-diag.invalid",
    classifiers=[
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Topic :: Scientific/Engineering",
    ],
    package_data={
        "flea_diag": ["py.typed", "*.pyi"],
        "flea_diag.tools.score": ["templates/*.html"],
        "flea_diag.web": ["static/*.js", "static/*.css", "static/uplot/*"],
    },
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*", "flea_sim_driver*"]),
    install_requires=REQUIRES,
    extras_require=EXTRAS,
    entry_points={"console_scripts": ["flea = flea_diag.tools.main:main"]},
    zip_safe=True,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (SHARE, ["package.xml"]),
        (f"lib/{PACKAGE}", sorted(str(path) for path in Path("launcher").glob("*"))),
        *folders("launch"),
        *folders("config"),
    ],
    **PYTHON,
)
