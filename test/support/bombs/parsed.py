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

"""What a parser of text says of a bomb, in a process with 500 MB and 10 processor seconds."""

from __future__ import annotations

import subprocess
import sys

from support.places import ROOT

BOUNDED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (500 << 20, 500 << 20))
resource.setrlimit(resource.RLIMIT_CPU, (10, 10))
from flea_diag.wire.{module} import {function}
try:
    {function}(sys.stdin.read())
except ValueError as error:
    print(error)
"""


def refusal(module: str, function: str, text: str) -> str:
    """Output of a parser that refuses a text and ends with status 0 and no other words."""
    program = BOUNDED.format(module=module, function=function)
    command = [sys.executable, "-c", program]
    ended = subprocess.run(
        command, input=text, capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout
