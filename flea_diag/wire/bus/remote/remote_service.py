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

"""A service of another package, whose type is looked up at run time: no dependency on it."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from typing import Any

from flea_diag.errors import ConfigurationError

_SEQUENCE = re.compile(r"sequence<([\w/]+)(?:, *\d+)?>")


def interface(name: str) -> Any:
    """Class of an interface, such as ``std_srvs/srv/Trigger`` or ``diagnostic_msgs/KeyValue``.

    Raises
    ------
    ConfigurationError
        Its package is not installed, or does not have it.
    """
    package, *kind, cls = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind[0] if kind else 'msg'}"), cls)
    except (ImportError, AttributeError) as error:
        raise ConfigurationError(
            f"the interface {name} is not available ({error}): install the package {package} and "
            "source it"
        ) from error


class RemoteService:
    """One service, which may start and stop at any time.

    Raises
    ------
    ConfigurationError
        The type is not installed.
    """

    def __init__(self, ros_node: Any, type_name: str, name: str) -> None:
        self._type = interface(type_name)
        self._client = ros_node.create_client(self._type, name)

    @property
    def ready(self) -> bool:
        """Whether a server is there."""
        return bool(self._client.service_is_ready())

    def call(self, values: Mapping[str, Any], told: Callable[[Any], None]) -> None:
        """Send a request; ``told`` is called with the response."""
        asked = self._client.call_async(filled(self._type.Request, values))
        asked.add_done_callback(lambda future: told(future.result()))


def filled(kind: Any, values: Mapping[str, Any]) -> Any:
    """A message of this class with those of the values that it has a field for.

    Releases differ in their fields. A message within is given as a mapping, a sequence as several.
    """
    types = kind.get_fields_and_field_types()
    message = kind()
    for name in types.keys() & values.keys():
        found = _SEQUENCE.fullmatch(types[name])
        value = values[name]
        if found is not None and "/" in found[1]:
            value = [filled(interface(found[1]), item) for item in value]
        elif isinstance(value, Mapping):
            value = filled(interface(types[name]), value)
        setattr(message, name, value)
    return message
