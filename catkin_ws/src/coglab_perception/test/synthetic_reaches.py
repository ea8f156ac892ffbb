"""Synthetic reaches of four patterns for tests, bench and the sample pattern file: minimum jerk with human scatter."""
import numpy as np
from coglab_sim.reach import Reach, duration_for

START = np.array([1.30, 0.20, 0.15])
ENDS = {"centre": (0.86, 0.03, 0.44), "high": (0.86, 0.05, 0.66), "left": (0.90, -0.28, 0.42),
        "right": (0.92, 0.42, 0.40)}


def reach(name, rng, noise=0.004, rate=30.0, rest=0.6, hold=0.4):
    """One noisy recording: (stamps, positions, onset time, duration)."""
    start = START + rng.normal(0, 0.02, 3)
    end = np.array(ENDS[name]) + rng.normal(0, 1, 3) * [0.03, 0.035, 0.03]
    duration = duration_for(float(np.linalg.norm(end - start)), 1.1) * float(np.exp(rng.normal(0, 0.15)))
    path = Reach(start, end, rest, duration, vertical_share=float(rng.uniform(0.8, 0.95)),
                 bow=float(rng.normal(0, 0.015)))
    stamps = np.arange(0.0, rest + duration + hold, 1.0 / rate) + rng.normal(0, 0.002)
    positions = np.array([path.at(t)[0] for t in stamps]) + rng.normal(0, noise, (len(stamps), 3))
    return stamps, positions, rest, duration


def demonstrations(n, seed, **kw):
    """n recordings per pattern: {name: [(stamps, positions), ...]}."""
    rng = np.random.default_rng(seed)
    return {name: [reach(name, rng, **kw)[:2] for _ in range(n)] for name in ENDS}
