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

"""A message package built from its .msg files by the generators that come with ROS 2.

What rosidl does through CMake is done here step by step, for ``ament_cmake`` is not on the package
index: the same generators write C, type support and Python, and one call of gcc makes the module.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np

PREFIX = Path(sys.prefix)
USED = ("std_msgs", "builtin_interfaces")
PARTS = (
    "rosidl_generator_c", "rosidl_typesupport_fastrtps_c", "rosidl_generator_py",
    "rosidl_typesupport_introspection_c",
)  # fmt: skip
LIBRARIES = (
    "stdc++", "fastcdr", "rosidl_runtime_c", "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c", *(f"{name}__{part}" for name in USED for part in PARTS),
)  # fmt: skip
TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""Libraries that are looked for by name on LD_LIBRARY_PATH; one file is all of them."""

GENERATE = """
import sys
from pathlib import Path
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_c.cli import GenerateC
from rosidl_generator_py.cli import GeneratePython
from rosidl_typesupport_c.cli import GenerateCTypesupport
from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

package, out = map(Path, sys.argv[1:])
files = []
for message in sorted(package.glob("msg/*.msg")):
    convert_msg_to_idl(package, package.name, message.relative_to(package), out / "idl" / "msg")
    files.append(f"{out / 'idl'}:msg/{message.stem}.idl")
BOTH = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]
for generator in (
    GenerateC("c"),
    GenerateFastRTPSCTypesupport("fastrtps_c"),
    GenerateIntrospectionCTypesupport("introspection_c"),
    GenerateCTypesupport("typesupport_c", typesupport_implementations=BOTH),
    GeneratePython("py", typesupport_implementations=["rosidl_typesupport_c"]),
):
    generator.generate(package.name, files, [f"{sys.prefix}/share"], out / package.name)
"""


def can_build() -> bool:
    """Whether generators, headers and a compiler are there."""
    headers = PREFIX / "include" / "rosidl_runtime_c"
    compiler = subprocess.run(["sh", "-c", "command -v gcc g++"], capture_output=True, check=False)
    return headers.is_dir() and compiler.returncode == 0


def built(package: Path, out: Path) -> Path:
    """Build the package into ``out``, which PYTHONPATH and LD_LIBRARY_PATH are to name."""
    environment = {**os.environ, "AMENT_PREFIX_PATH": str(PREFIX)}
    _run([sys.executable, "-c", GENERATE, str(package), str(out)], environment)
    made = out / package.name
    (made / "__init__.py").touch()
    sources = [str(path) for end in ("*.c", "*.cpp") for path in sorted(made.rglob(end))]
    include = [PREFIX / "include", *sorted((PREFIX / "include").iterdir()), out]
    include += [Path(sysconfig.get_paths()["include"]), Path(np.get_include())]
    module = f"{package.name}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
    _run(
        ["gcc", "-shared", "-fPIC", "-O0", "-w", *(f"-I{path}" for path in include), *sources,
         "-o", str(made / module), f"-L{PREFIX}/lib", f"-Wl,-rpath,{PREFIX}/lib",
         *(f"-l{name}" for name in LIBRARIES)],
        environment,
    )  # fmt: skip
    for name in TYPE_SUPPORTS:
        (out / f"lib{package.name}__{name}.so").symlink_to(made / module)
    return out


def _run(command: list[str], environment: dict[str, str]) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
