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

"""The reporter where ros2_medkit is not installed; what it reports is in test_fault_report."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from support.live import Process, node


@pytest.mark.skipif(find_spec("ros2_medkit_msgs") is not None, reason="ros2_medkit is installed")
def test_without_the_type_of_the_service_it_says_what_to_install(domain: int) -> None:
    with Process(node("fault_reporter"), domain) as process:
        process.wait_for("install the package ros2_medkit_msgs and source it\n")
        assert process.child.wait(20.0) == 2
    assert process.output.count("\n") == 1
