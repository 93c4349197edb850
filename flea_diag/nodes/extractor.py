"""``ros2 run flea_diag extractor``: undecoded vibration in, features on request out."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from flea_diag.wire.bus import Program, run


def program() -> Program:
    """What this node is; the imports are slow and wait until signals are in hand."""
    from flea_diag.configuration import EXTRACTOR
    from flea_diag.nodes.adapter import StagePorts, stage_program
    from flea_diag.wire import records as r

    return stage_program(
        "extractor",
        "Keeps the last seconds of vibration as they came in and computes a feature on request.",
        EXTRACTOR,
        StagePorts(
            subscribes=(r.ChannelTable, r.VibrationBlock, r.Scan, r.FeatureRequest),
            publishes=(r.VibrationLevel, r.FeatureValue),
        ),
        examples=("ros2 topic echo /feature",),
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the exit status."""
    return run(program, argv)


if __name__ == "__main__":
    sys.exit(main())
