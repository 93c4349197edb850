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

"""Scans for tests of the observer, and what they look for among its records."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.wire.records import (
    ChannelQuality,
    DataQuality,
    Detection,
    Record,
    Scan,
    Symbols,
)
from support import stands
from support.models import linear_ema as ema


@lru_cache(maxsize=1)
def healthy() -> list[Scan]:
    """20 s of a healthy actuator in motion."""
    return stands.scans(ema.noisy(ema.run(seconds=20.0), 50))


@lru_cache(maxsize=1)
def jammed() -> list[Scan]:
    """Drag from 10 s on."""
    worse = ema.changed(coulomb=200.0, viscous=1500.0)
    return stands.scans(ema.noisy(ema.run(seconds=20.0, faulty=worse, onset_s=10.0), 51))


def after(scan: Scan, **ns_and_values: float) -> Scan:
    """Same scan with some channels changed."""
    values = dict(zip(scan.channels, scan.values, strict=True)) | ns_and_values
    return Scan(scan.stamp_ns, tuple(values), tuple(values.values()))


def quality(record: DataQuality, channel: str) -> ChannelQuality:
    """The row of one channel."""
    return next(row for row in record.channels if row.channel == channel)


def counters(stage: ObserverStage, last: Scan, channel: str) -> dict[str, int]:
    """Counters at the end of the stream; ``last`` sent again causes a record of them."""
    stage.handle(last)
    (record,) = stage.finish()
    assert isinstance(record, DataQuality)
    return dict(quality(record, channel).counters)


def decisions(records: Iterable[Record]) -> list[Record]:
    """Detections and symbols."""
    records = list(records)
    return stands.of(Detection, records) + stands.of(Symbols, records)
