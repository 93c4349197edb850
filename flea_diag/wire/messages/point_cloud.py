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

"""Waveforms: a VibrationBlock as sensor_msgs/PointCloud2, height 1, one point per sample.

Fields are ``t`` (uint32, ns after the stamp) and one float32 (m/s^2) per axis. This is the layout
of ``VibrationBlock.data``, so the samples are transferred by one copy of bytes.
"""

from __future__ import annotations

from flea_diag.errors import WireError
from flea_diag.wire import records as r
from flea_diag.wire.messages.cdr import CdrReader, CdrWriter

_UINT32, _FLOAT32 = 6, 7
"""Datatypes of sensor_msgs/PointField."""

_TIME_FIELD = "t"
_POINT_FIELD_LEAST_BYTES = 13


def _point_step(axes: tuple[str, ...]) -> int:
    return 4 + 4 * len(axes)


def _point_fields(axes: tuple[str, ...]) -> list[tuple[str, int, int, int]]:
    """Name, offset, datatype and count of each field."""
    return [
        (name, 4 * number, _FLOAT32 if number else _UINT32, 1)
        for number, name in enumerate((_TIME_FIELD, *axes))
    ]


def encode(block: r.VibrationBlock, _: str) -> bytes:
    """CDR bytes of a block."""
    step, size = _point_step(block.axes), len(block.data)
    if size != step * block.count:
        raise WireError(
            f"VibrationBlock: {size} bytes of data, but {block.count} points of "
            f"{len(block.axes)} axes take {step * block.count}"
        )
    writer = CdrWriter(block.stamp_ns)
    height, big_endian, dense = 1, False, False  # not dense: a sample that was not taken is NaN
    writer.u32(height)
    writer.u32(block.count)
    writer.u32(1 + len(block.axes))
    for name, offset, datatype, count in _point_fields(block.axes):
        writer.text(name)
        writer.u32(offset)
        writer.u8(datatype)
        writer.u32(count)
    writer.u8(big_endian)
    for number in (step, size, size):  # point step, row step, length of data
        writer.u32(number)
    writer.raw(block.data)
    writer.u8(dense)
    return bytes(writer)


def decode(_: type, reader: CdrReader) -> r.VibrationBlock:
    """Read a block; its samples are copied once and not decoded."""
    stamp_ns = reader.stamp_ns()
    height, width = reader.u32(), reader.u32()
    fields = [_point_field(reader) for _ in range(reader.count(_POINT_FIELD_LEAST_BYTES))]
    axes = tuple(name for name, *_ in fields[1:])
    if fields != _point_fields(axes):
        raise WireError("point fields must be t (uint32) and one float32 per axis")
    big_endian, step, row_step = reader.u8(), reader.u32(), reader.u32()
    data = reader.take(reader.u32())
    reader.u8()
    reader.end()
    if big_endian or height != 1 or step != _point_step(axes):
        raise WireError(
            f"height {height}, point step {step}, big endian {big_endian}; a block must have "
            f"height 1, point step {_point_step(axes)} and be little endian"
        )
    if not len(data) == row_step == step * width:
        raise WireError(f"{len(data)} bytes of data, {width} points of {step} bytes announced")
    return r.VibrationBlock(stamp_ns, axes, width, bytes(data))


def _point_field(reader: CdrReader) -> tuple[str, int, int, int]:
    return reader.text(), reader.u32(), reader.u8(), reader.u32()
