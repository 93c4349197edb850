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

"""Samples of Imu, arrays and points become blocks with the times and units of the accelerometer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from support.foreign import arm

from flea_diag.errors import WireError
from flea_diag.wire.records import VibrationBlock
from flea_diag.wire.sources.field_path import FieldPath
from flea_diag.wire.sources.mapping import AxisMapping
from flea_diag.wire.sources.vibration_stream import VibrationStream

T = get_typestore(Stores.ROS2_JAZZY).types
G, MS, START_NS = 9.80665, 1_000_000, 10**18
IMU, ARRAY, POINTS = (
    "sensor_msgs/msg/Imu",
    "std_msgs/msg/Float32MultiArray",
    "sensor_msgs/msg/PointCloud2",
)


def axes(message: str, places: dict[str, str], rate_hz: float, factor: float = 1.0) -> Any:
    return [
        AxisMapping(
            f"accelerometer_1_{axis}", place, factor, -500.0, 500.0, rate_hz, topic="/vibration",
            message=message, path=None if message == POINTS else FieldPath.parsed(place, "here"),
        )
        for axis, place in places.items()
    ]  # fmt: skip


def blocks(stream: VibrationStream, sent: list[tuple[int, Any]]) -> list[VibrationBlock]:
    made = [block for stamp_ns, message in sent for block in stream.push(stamp_ns, message)]
    return [*made, *stream.finish()]


def joined(made: list[VibrationBlock]) -> tuple[Any, Any]:
    """Stamps and samples of all blocks."""
    parts = [
        (block.stamp_ns + block.points()[0].astype(np.int64), block.points()[1]) for block in made
    ]
    return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def vector(x: float, z: float) -> Any:
    return T["geometry_msgs/msg/Vector3"](x, 0.0, z)


def imu(k: int) -> Any:
    turn, none = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9)
    header = arm.header_at(START_NS + k * MS)
    return T[IMU](header, turn, none, vector(0, 0), none, vector(0.5 * k, -0.25 * k), none)


def test_an_imu_has_a_sample_a_message_and_a_gap_ends_a_block() -> None:
    stream = VibrationStream(
        axes(IMU, {"x": "linear_acceleration.x", "z": "linear_acceleration.z"}, 1000.0)
    )
    numbers = [k for k in range(260) if not 120 <= k < 240]
    made = blocks(stream, [(START_NS + k * MS, imu(k)) for k in numbers])
    assert [block.count for block in made] == [50, 50, 20, 20]
    assert made[0].axes == ("accelerometer_1_x", "accelerometer_1_z")
    stamps_ns, samples = joined(made)
    assert stamps_ns.tolist() == [START_NS + k * MS for k in numbers]
    np.testing.assert_array_equal(samples, [[0.5 * k, -0.25 * k] for k in numbers])


def test_an_array_has_its_samples_a_period_apart_in_any_unit() -> None:
    stream = VibrationStream(axes(ARRAY, {"x": "data"}, 10_000.0, G))
    layout = T["std_msgs/msg/MultiArrayLayout"]([], 0)
    values = np.arange(1000, dtype=np.float32) / 64.0
    sent = [
        (START_NS + k * 10 * MS, T[ARRAY](layout, values[100 * k : 100 * (k + 1)]))
        for k in range(10)
    ]
    stamps_ns, samples = joined(blocks(stream, sent))
    assert set(np.diff(stamps_ns)) == {100_000}
    np.testing.assert_allclose(samples[:, 0], G * values, rtol=1e-6)


@pytest.mark.parametrize("order", ["<", ">"])
def test_points_have_fields_of_any_kind_and_times_of_their_own(order: str) -> None:
    """As a DAQ packs them, with a counter between the axes, in either order of bytes."""
    kind = np.dtype(
        {
            "names": ["x", "count", "t", "z"],
            "formats": [f"{order}f4", "u1", f"{order}u4", f"{order}i2"],
            "offsets": [0, 4, 8, 12],
            "itemsize": 16,
        }
    )
    points = np.zeros(600, dtype=kind)
    points["x"], points["z"] = np.arange(600) / 8.0, np.arange(600)
    points["t"] = np.arange(600) * 99_000
    field = T["sensor_msgs/msg/PointField"]
    fields = [
        field("x", 0, 7, 1),
        field("count", 4, 2, 1),
        field("t", 8, 6, 1),
        field("z", 12, 3, 1),
    ]
    data = np.frombuffer(points.tobytes(), dtype=np.uint8)
    message = T[POINTS](
        arm.header_at(START_NS), 1, 600, fields, order == ">", 16, 16 * 600, data, True
    )
    stream = VibrationStream(axes(POINTS, {"x": "x", "z": "z"}, 10_000.0))
    stamps_ns, samples = joined(blocks(stream, [(START_NS, message)]))
    np.testing.assert_array_equal(stamps_ns - START_NS, np.arange(600) * 99_000)
    np.testing.assert_array_equal(samples[:, 0], np.arange(600) / 8.0)
    np.testing.assert_array_equal(samples[:, 1], np.arange(600))


def test_what_holds_no_samples_is_refused_by_its_field() -> None:
    layout = T["std_msgs/msg/MultiArrayLayout"]([], 0)
    message = T[ARRAY](layout, np.zeros(3, dtype=np.float32))
    with pytest.raises(WireError, match="no field 'datum'"):
        list(VibrationStream(axes(ARRAY, {"x": "datum"}, 1e4)).push(0, message))
    with pytest.raises(WireError, match="layout holds no samples of accelerometer_1_x"):
        list(VibrationStream(axes(ARRAY, {"x": "layout"}, 1e4)).push(0, message))
    both = axes(ARRAY, {"x": "data", "y": "data[0]"}, 1e4)
    with pytest.raises(WireError, match="1 to 3 samples, must be as many"):
        list(VibrationStream(both).push(0, message))
    cloud = T[POINTS](arm.header_at(0), 1, 5, [], False, 4, 20, np.zeros(20, np.uint8), True)
    with pytest.raises(WireError, match="points have no field 'x'"):
        list(VibrationStream(axes(POINTS, {"x": "x"}, 1e4)).push(0, cloud))
