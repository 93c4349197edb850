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

"""The recorder against DDS: nothing that was recorded is lost, however it ends."""

from __future__ import annotations

import shutil
import signal
import time
from pathlib import Path

import pytest
from support.live import Peer, Process
from support.places import FLEA_STAND
from support.recordings import opened, publish, recorder, scan, until_written

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.recording.recorder import checked_directory, chosen_topics
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import Health, Scan, Truth
from flea_diag.wire.topics import TOPICS


def read(directory: Path) -> dict[str, list[tuple[int, int, bytes]]]:
    """Per topic: log time, publish time and bytes, read by another library than the writer's."""
    from mcap.reader import make_reader

    found: dict[str, list[tuple[int, int, bytes]]] = {}
    with (directory / f"{directory.name}_0.mcap").open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            row = (message.log_time, message.publish_time, message.data)
            found.setdefault(channel.topic, []).append(row)
    return found


def test_sigterm_closes_the_bag(domain: int, tmp_path: Path) -> None:
    bag = tmp_path / "run"
    with Process(recorder(bag), domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        publish(peer, 20)
        until_written(peer, 21)
        assert process.signal(signal.SIGTERM) == 0
    assert f"messages in {bag}" in process.output
    rows = read(bag)["/sensors/slow"]
    assert [publish_ns for _, publish_ns, _ in rows] == [scan(k).stamp_ns for k in range(20)]
    assert all(log_ns > publish_ns for log_ns, publish_ns, _ in rows)
    from flea_diag.wire.messages import codec

    assert [codec.decode(Scan, data) for _, _, data in rows] == [scan(k) for k in range(20)]
    assert opened(bag)["/sensors/channels"] == 1


def test_a_latched_record_of_any_age_is_no_lag(domain: int, tmp_path: Path) -> None:
    """What was said an hour ago is received by a recorder that starts now; it is not slow."""
    hour_ns = 3600 * 10**9
    with Process(recorder(tmp_path / "run"), domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        assert peer.heard(Scan)
        peer.bus.publish(Truth(time.time_ns() - hour_ns, "nominal", -1))
        peer.bus.publish(Scan(time.time_ns(), ("motor_current",), (0.0,)))
        until_written(peer, 2)
        assert process.signal(signal.SIGTERM) == 0
    lags_ms = [
        float(text)
        for record in peer.records
        if isinstance(record, Health)
        for name, text in record.values
        if name == "worst_lag_ms"
    ]
    assert lags_ms
    assert 0.0 < max(lags_ms) < 0.1 * hour_ns / 1e6


def test_a_message_from_before_1970_ends_no_recording(domain: int, tmp_path: Path) -> None:
    bag = tmp_path / "run"
    with Process(recorder(bag), domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        publish(peer, 5)
        peer.bus.publish(Scan(-1, ("motor_current",), (0.0,)))
        peer.bus.publish(scan(5))
        until_written(peer, 8)
        assert process.signal(signal.SIGTERM) == 0
    assert "is before 1970" in process.output
    rows = read(bag)["/sensors/slow"]
    assert len(rows) == 7, "it is kept, too"
    assert rows[-1][1] == scan(5).stamp_ns


def test_kill_9_leaves_a_bag_that_opens_as_it_stands(domain: int, tmp_path: Path) -> None:
    bag = tmp_path / "run"
    with Process(recorder(bag), domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        publish(peer, 20)
        until_written(peer, 21)
        assert process.signal(signal.SIGKILL) == -signal.SIGKILL
    counts = opened(bag)
    assert counts["/sensors/slow"] == 20
    assert counts["/sensors/channels"] == 1


def test_a_full_disk_ends_the_recording_with_a_whole_bag(domain: int, tmp_path: Path) -> None:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    bag = tmp_path / "run"
    with Process(recorder(bag), domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        publish(peer, 20)
        until_written(peer, 21)
        # The disk is not filled: the limit is raised above what is free on it.
        request = SetParameters.Request()
        request.parameters = [Parameter("stop_free_mb", value=10**12).to_parameter_msg()]
        peer.call(SetParameters, "/recorder/set_parameters", request)
        assert process.end() == 2
    assert "recording ended" in process.output
    assert "stop_free_mb = 1000000000000" in process.output
    assert opened(bag)["/sensors/slow"] == 20


def test_no_start_on_a_full_disk(domain: int, tmp_path: Path) -> None:
    with Process(recorder(tmp_path / "run", "-p", f"stop_free_mb:={10**12}"), domain) as process:
        assert process.end() == 2
    assert "free disk space or choose another directory" in process.output
    assert not (tmp_path / "run").exists()


def test_a_namespace_is_in_the_bags_topic_names(domain: int, tmp_path: Path) -> None:
    bag = tmp_path / "run"
    command = recorder(bag, "-p", "topics:=[sensors/slow]", "-r", "__ns:=/stand_2")
    with (
        Process(command, domain) as process,
        Peer(domain, "/stand_2") as inside,
        Peer(domain) as outside,
    ):
        inside.listen(Health)
        assert inside.heard(Scan)
        outside.bus.publish(scan(1))
        inside.bus.publish(scan(2))
        until_written(inside, 1)
        assert process.signal(signal.SIGINT) == 0
    assert opened(bag) == {"/stand_2/sensors/slow": 1}


def test_an_existing_directory_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"exists: name a new bag"):
        checked_directory(str(tmp_path))


def test_what_the_diagnosis_rests_on_is_kept_in_every_file(domain: int, tmp_path: Path) -> None:
    from flea_diag.configuration.files import config_path

    bag = tmp_path / "run"
    # Without its own reports, which count as messages, too.
    topics = "topics:=[sensors/slow, sensors/channels, sensors/vibration]"
    command = recorder(bag, "-p", "split_s:=0.000001", "-p", topics)
    with Process(command, domain) as process, Peer(domain) as peer:
        peer.listen(Health)
        publish(peer, 3)
        until_written(peer, 4)
        assert process.signal(signal.SIGINT) == 0
    assert opened(bag)["/sensors/slow"] == 3
    files = sorted(bag.glob("*.mcap"))
    assert len(files) > 2
    for file in files:
        kept = BagReader(file).attachments
        assert kept["stand.yaml"] == config_path("stands/flea/stand.yaml").read_text()
        assert kept["features.yaml"] == config_path("feature_table.yaml").read_text()
        assert kept["faults.yaml"] == config_path("faults.yaml").read_text()
        assert kept["actuator.yaml"] == config_path("actuator.yaml").read_text()
        assert kept["calibration.yaml"] == (
            config_path("calibration_simulated_stand.yaml").read_text()
        )
        assert "numpy 2" in kept["versions.txt"] or "numpy 1" in kept["versions.txt"]


def test_the_stand_that_is_kept_is_the_one_that_was_given(domain: int, tmp_path: Path) -> None:
    mine, bag = tmp_path / "mine", tmp_path / "run"
    shutil.copytree(FLEA_STAND, mine)
    text = (mine / "stand.yaml").read_text(encoding="utf-8").replace("name: flea", "name: mine")
    (mine / "stand.yaml").write_text(text, encoding="utf-8")
    other = tmp_path / "other.yaml"
    other.write_text("schema_version: 1\n", encoding="utf-8")
    command = recorder(bag, "-p", "stand:=./mine", "-p", "calibration:=other.yaml")
    with Process(command, domain, cwd=tmp_path) as process, Peer(domain) as peer:
        peer.listen(Health)
        publish(peer, 3)
        until_written(peer, 4)
        assert process.signal(signal.SIGINT) == 0
    kept = BagReader(next(bag.glob("*.mcap"))).attachments
    assert kept["stand.yaml"] == text
    assert kept["calibration.yaml"] == "schema_version: 1\n"
    assert kept["actuator.yaml"] == (mine / "actuator.yaml").read_text(encoding="utf-8")


def test_a_configuration_that_is_not_there_stops_the_start(domain: int, tmp_path: Path) -> None:
    with Process(recorder(tmp_path / "run", "-p", "calibration:=no/such.yaml"), domain) as process:
        assert process.end() == 2
    assert "no/such.yaml: no such file" in process.output
    assert not (tmp_path / "run").exists()


def test_topics_are_chosen_by_name() -> None:
    assert [topic.record for topic in chosen_topics(("sensors/slow", "/diagnostics"))] == [
        Scan,
        Health,
    ]
    assert len(chosen_topics(("all",))) == len(TOPICS)
    with pytest.raises(ConfigurationError, match="'sensors/slwo' is unknown"):
        chosen_topics(("sensors/slwo",))
