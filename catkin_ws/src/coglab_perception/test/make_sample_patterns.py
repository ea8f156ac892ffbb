#!/usr/bin/python3
"""Train config/patterns.json, the sample patterns, on synthetic reaches (40 per pattern, seed 2026). Usage: OUTPUT."""

import sys

from coglab_perception.recogniser import RecogniserSettings, save_patterns, train_patterns
from synthetic_reaches import demonstrations

save_patterns(
    sys.argv[1],
    train_patterns(demonstrations(40, seed=2026)),
    RecogniserSettings(),
    "synthetic reaches, 40 per pattern, seed 2026, 4 mm noise at 30 Hz; replace by a lab's own recordings",
)
