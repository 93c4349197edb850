"""What the isolator is told: parameters of a user, and the knowledge it starts with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.faults.fault import Fault
from flea_diag.core.signatures.signature import SignatureTable
from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class IsolatorParameters:
    """What a user may set on the isolator."""

    watermark_s: float = parameter(
        0.2,
        "how long records wait for those of other topics",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    answer_budget_s: float = parameter(
        0.15, "stamp of a feature's answer after its request", unit="s", minimum=0.0, maximum=5.0
    )
    answer_limit_s: float = parameter(
        2.0, "give a feature up when no answer has come by then", unit="s", minimum=0.1, maximum=60
    )
    feature_window_s: float = parameter(
        1.0, "length of vibration that a feature is computed on", unit="s", minimum=0.1, maximum=5
    )
    feature_windows: int = parameter(
        3, "windows, one after the other, that features are asked for on", minimum=1, maximum=100
    )
    feature_patience_s: float = parameter(
        5.0, "wait so long for a window in motion before the group is final", unit="s", minimum=0.0
    )
    onset_s: float = parameter(
        0.2,
        "scans this soon after the detection are no evidence: smoothing still shows the onset",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    settle_samples: int = parameter(
        200, "moving scans after the detection before features are asked for", minimum=1
    )
    settle_s: float = parameter(
        4.0, "the same as a time, for a stand that hardly moves", unit="s", minimum=0.1
    )
    drop_nats: float = parameter(
        3.5, "log-likelihood behind the best at which a fault is dropped", unit="1", minimum=0.1
    )
    explain_nats: float = parameter(
        3.0, "log-likelihood a fault must gain over no fault to explain anything", minimum=0.0
    )
    rest_s: float = parameter(
        60.0, "without motion for so long nothing is observable", unit="s", minimum=1.0
    )
    likelihood: bool = parameter(
        True, "weigh the faults that are left by likelihood (off: signs and features alone)"
    )
    gating: bool = parameter(
        True,
        "hold symbols against the quadrants passed through only, and let likelihoods wait for "
        "motion both ways (off: for comparisons)",
    )
    strategy: str = parameter(
        "optimal",
        "how the next feature is chosen",
        choices=("optimal", "information", "balanced", "paper"),
    )
    source: str = parameter("live", "what the verdicts rest on", choices=("live", "replay"))


@dataclass(frozen=True)
class Knowledge:
    """What the isolator knows before the first record; ``features``: what it may ask for."""

    calibration: Calibration
    calibration_sha256: str
    faults: Mapping[str, Fault]
    signatures: Mapping[Quadrant, SignatureTable]
    features: FaultFeatureTable
