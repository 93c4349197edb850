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

r"""Human-readable text of each judgement, for any viewer of DiagnosticArray.

``ros2 topic echo`` prints a level as ``\x01``, so the text begins with the level in words. This
text is never parsed: the key/values beside it hold the record.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from flea_diag.wire import records as r
from flea_diag.wire.records import Level, Quality


class Words(NamedTuple):
    """Level, name and message of one status."""

    level: Level
    name: str
    message: str


CERTAIN, MORE_LIKELY = 0.999, 0.5
QUALITY_LEVEL: dict[Quality, Level] = {
    Quality.GOOD: Level.OK,
    Quality.ABSENT: Level.OK,
    Quality.BAD: Level.WARN,
    Quality.SATURATED: Level.WARN,
    Quality.STALE: Level.STALE,
}


def words_of(part: Any, whole: Any = None) -> Words:
    """Text of a record, or of one part of the record ``whole``."""
    words: Words = _WORDS[type(part)](part, whole)
    return words._replace(message=f"{words.level.name}: {words.message}")


def sentence_of(words: Words) -> str:
    """The message without its level, for where the level is shown beside it."""
    return words.message.removeprefix(f"{words.level.name}: ")


def _verdict_level(group: r.AmbiguityGroup | r.Hypotheses) -> Level:
    stale = isinstance(group, r.AmbiguityGroup) and group.stale
    return Level.STALE if stale else r.OUTCOME_LEVEL[group.outcome]


def _channel_table(table: r.ChannelTable, _: None) -> Words:
    sentence = f"{len(table.channels)} channels of stand {table.stand}"
    return Words(Level.OK, "sensors/channels", sentence)


def _channel_info(info: r.ChannelInfo, _: r.ChannelTable) -> Words:
    sentence = f"{info.minimum:g} to {info.maximum:g} {info.unit} at {info.rate_hz:g} Hz"
    return Words(Level.OK, f"sensors/channels/{info.name}", sentence)


def _data_quality(quality: r.DataQuality, _: None) -> Words:
    wrong = [row for row in quality.channels if QUALITY_LEVEL[row.quality] is not Level.OK]
    said = [f"{row.channel} {row.quality.value}" for row in wrong]
    said += [f"{row.residual} not judged" for row in quality.judged if not row.judged]
    return Words(
        Level.WARN if said else Level.OK,
        "data_quality",
        ", ".join(said) or f"{len(quality.channels)} channels, none bad",
    )


def _channel_quality(row: r.ChannelQuality, _: r.DataQuality) -> Words:
    sentence = f"{row.quality.value}: {row.reason}" if row.reason else row.quality.value
    return Words(QUALITY_LEVEL[row.quality], f"data_quality/{row.channel}", sentence)


def _known(value: float, digits: int = 4) -> str:
    return "unknown" if math.isnan(value) else f"{value:.{digits}g}"


def _detection(flag: r.Detection, _: None) -> Words:
    if not flag.detected:
        said = f": {flag.test}" if flag.test.startswith(r.TAKEN_BACK) else ""
        return Words(Level.OK, "fault_detected", f"no fault detected{said}")
    if flag.test == r.TAKEN_OVER:
        return Words(Level.WARN, "fault_detected", f"episode {flag.episode} resumed, still open")
    sentence = (
        f"{flag.test} on {flag.residual}: z = {_known(flag.z)}, "
        f"threshold {_known(flag.threshold)}, episode {flag.episode}"
    )
    return Words(Level.WARN, "fault_detected", sentence)


def _symbols(symbols: r.Symbols, _: None) -> Words:
    sentence = ", ".join(f"{s.residual} ({s.magnitude}{s.slope})" for s in symbols.symbols)
    return Words(Level.WARN, "symbol", sentence or "no symbols")


def _symbol(symbol: r.Symbol, _: r.Symbols) -> Words:
    sentence = f"magnitude {symbol.magnitude}, slope {symbol.slope}"
    return Words(Level.OK, f"symbol/{symbol.residual}", sentence)


def _ambiguity_group(group: r.AmbiguityGroup, _: None) -> Words:
    stale = "the source has stopped; last verdict: " if group.stale else ""
    return Words(_verdict_level(group), "ambiguity_group", f"{stale}{group.words}")


def _hypotheses(found: r.Hypotheses, _: None) -> Words:
    sentence = f"{len(found.members)} possible, {len(found.dropped)} ruled out"
    return Words(_verdict_level(found), "hypotheses", sentence)


def _candidate(candidate: r.Candidate, group: r.AmbiguityGroup | r.Hypotheses) -> Words:
    # A fault keeps its name when it is ruled out: a viewer that shows the last status of each
    # name then shows the change instead of an outdated suspect.
    topic = "hypotheses" if isinstance(group, r.Hypotheses) else "ambiguity_group"
    name = f"{topic}/{candidate.fault}"
    if not any(candidate is member for member in group.members):
        return Words(Level.OK, name, f"dropped: {candidate.reason}")
    probability = candidate.probability
    if CERTAIN < probability < 1.0:  # no rounding makes it certain
        probability = CERTAIN
    sentence = f"possible, probability {_known(probability, 3)}: {candidate.reason}"
    return Words(_verdict_level(group), name, sentence)


def _window(start_ns: int, end_ns: int) -> str:
    return f"over {(end_ns - start_ns) * 1e-9:.3f} s"


def _feature_request(request: r.FeatureRequest, _: None) -> Words:
    window = _window(request.window_start_ns, request.window_end_ns)
    return Words(Level.OK, "feature_request", f"{request.feature} {window}")


def _feature_value(value: r.FeatureValue, _: None) -> Words:
    if value.reason:
        sentence = f"{value.feature} not computable: {value.reason}"
        return Words(Level.WARN, "feature", sentence)
    sentence = (
        f"{value.feature} = {_known(value.value)} {value.unit} ({value.symbol}), nominal "
        f"{_known(value.nominal_low)} to {_known(value.nominal_high)}"
    )
    return Words(Level.OK, "feature", sentence)


def _size_trend(told: r.SizeTrend, _: None) -> Words:
    unit = "" if told.unit == "1" else f" {told.unit}"
    said = f"{told.fault}, {told.quantity} {_known(told.level, 3)}{unit}: {told.direction}"
    if told.crossed > MORE_LIKELY:
        return Words(Level.ERROR, "size_trend", f"{said}, limit {told.limit:.3g}{unit} crossed")
    if told.median_ns == r.NEVER_NS:
        return Words(Level.OK, "size_trend", said)
    left_s = (told.median_ns - told.stamp_ns) / 1e9
    return Words(
        Level.WARN, "size_trend", f"{said}, limit {told.limit:.3g}{unit} in {left_s:.3g} s"
    )


def _truth(truth: r.Truth, _: None) -> Words:
    level = Level.OK if truth.fault == "nominal" else Level.WARN
    return Words(level, "truth", truth.fault)


def _remark(remark: r.Remark, _: None) -> Words:
    whole = remark.kind.is_on_unit or remark.kind.is_on_service
    alone = remark.kind is r.RemarkKind.MARK or whole
    episode = "" if alone else " on an episode"
    said = f": {remark.text}" if remark.text else ""
    return Words(Level.OK, "remark", f"{remark.kind.value} by {remark.author}{episode}{said}")


_WORDS: dict[type, Any] = {
    r.ChannelTable: _channel_table,
    r.ChannelInfo: _channel_info,
    r.DataQuality: _data_quality,
    r.ChannelQuality: _channel_quality,
    r.Detection: _detection,
    r.Symbols: _symbols,
    r.Symbol: _symbol,
    r.Hypotheses: _hypotheses,
    r.AmbiguityGroup: _ambiguity_group,
    r.Candidate: _candidate,
    r.FeatureRequest: _feature_request,
    r.FeatureValue: _feature_value,
    r.SizeTrend: _size_trend,
    r.Truth: _truth,
    r.Remark: _remark,
}
