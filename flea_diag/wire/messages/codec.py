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

"""Conversion of records to message bytes and back: the only place that knows ROS message types.

``encode`` returns little-endian CDR, which ``Publisher.publish`` of rclpy and an MCAP channel of
rosbag2 both accept: one codec serves the live graph, the bags and the tests. It needs neither ROS
nor a bag library. One file per message type: ``joint_state``, ``point_cloud``,
``diagnostic_array``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar, cast

from flea_diag.errors import WireError
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.messages import diagnostic_array, gate, joint_state, point_cloud
from flea_diag.wire.messages.cdr import CdrReader
from flea_diag.wire.records import Record
from flea_diag.wire.topics import DIAGNOSTIC_ARRAY, JOINT_STATE, POINT_CLOUD, TOPIC_OF

R = TypeVar("R")


class Carrier(NamedTuple):
    """Writer and reader of one message type; messages above ``limit_bytes`` are refused."""

    encode: Callable[[Any, str], bytes]
    decode: Callable[[type, CdrReader], Any]
    limit_bytes: int


CARRIERS: dict[str, Carrier] = {
    JOINT_STATE: Carrier(joint_state.encode, joint_state.decode, 1 << 20),
    DIAGNOSTIC_ARRAY: Carrier(diagnostic_array.encode, diagnostic_array.decode, 4 << 20),
    POINT_CLOUD: Carrier(point_cloud.encode, point_cloud.decode, 64 << 20),
}


def encode(record: Record, stand: str = "stand") -> bytes:
    """Write a record as CDR; ``stand`` is the stand's name in the hardware id of judgements.

    Raises
    ------
    WireError
        The record is inconsistent, or contains a value that the message cannot represent.
    """
    message = TOPIC_OF[type(record)].message
    data = CARRIERS[message].encode(record, stand)
    _check_size(type(record), message, len(data))
    return data


def encode_block(block: ResidualBlock) -> Iterator[bytes]:
    """Write each record of a block as CDR, the very same bytes at a fraction of the cost."""
    return joint_state.encode_residuals(block)


def decode(record_type: type[R], data: bytes | memoryview) -> R:
    """Read a record of this type from CDR.

    Raises
    ------
    WireError
        The bytes are truncated, oversized, or of another type.
    """
    message = TOPIC_OF[record_type].message
    view = memoryview(data).cast("B")
    _check_size(record_type, message, len(view))
    try:
        record = None
        if message == JOINT_STATE and isinstance(data, bytes):
            record = joint_state.repeated(record_type, data)
        if record is None:
            record = CARRIERS[message].decode(record_type, CdrReader(view))
        gate.check(record)
    except WireError as error:
        raise WireError(f"{record_type.__name__}: {error}", error.kind) from None
    return cast(R, record)


def message_class(record_type: type) -> Any:
    """Import the rclpy message class that carries a record type.

    Raises
    ------
    WireError
        The ROS message packages are not installed; names what to install.
    """
    package, _, name = TOPIC_OF[record_type].message.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError as error:
        raise WireError(
            f"the ROS messages {package} cannot be imported ({error}): source a ROS 2 "
            f"installation, or pip install ros-jazzy-common-interfaces"
        ) from error


def _check_size(record_type: type, message: str, size: int) -> None:
    limit = CARRIERS[message].limit_bytes
    if size > limit:
        raise WireError(
            f"{record_type.__name__} of {size} bytes is above the limit of {limit} bytes "
            f"for a {message}",
            "size",
        )
