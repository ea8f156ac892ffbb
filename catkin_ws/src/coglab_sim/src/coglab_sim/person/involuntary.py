"""What a hand does without its owner's will."""

from __future__ import annotations

import numpy as np

from coglab_sim.person.participant import Participant


def involuntary(p: Participant, f: np.ndarray, t: float) -> np.ndarray:
    """Displacement (m) by sway (0.3-1 Hz) and tremor (8-12 Hz) at time t: sums of sines with the phases ``f`` (3 x 4),
    bounded and smooth."""
    sway = np.sin(2 * np.pi * 0.35 * t + f[:, 0]) + 0.5 * np.sin(2 * np.pi * 0.8 * t + f[:, 1])
    tremor = np.sin(2 * np.pi * 9.1 * t + f[:, 2]) + 0.6 * np.sin(2 * np.pi * 11.3 * t + f[:, 3])
    return p.sway / 1.5 * sway + p.tremor / 1.6 * tremor
