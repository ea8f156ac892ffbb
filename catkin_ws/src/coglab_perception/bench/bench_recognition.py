#!/usr/bin/python3
"""Bench of motion recognition on unseen synthetic reaches; the peer is the nearest end point seen so far."""

import json
import sys
import time
from pathlib import Path

import numpy as np
from coglab_perception.recogniser import UNKNOWN, Recogniser, train_patterns

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from synthetic_reaches import ENDS, START, demonstrations, reach

REACHES = 100
"""per pattern"""


def row(figure, value, unit, goal="", ok=True, peer=None, peer_value=None):
    """One row of the bench table."""
    return {
        "bench": "recognition",
        "figure": figure,
        "value": round(float(value), 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": peer_value if peer_value is None else round(float(peer_value), 4),
        "ok": bool(ok),
    }


def nearest_direction(displacement):
    """The peer: which end point lies nearest to the direction of the displacement so far."""
    d = displacement / max(1e-9, float(np.linalg.norm(displacement)))
    return max(ENDS, key=lambda n: float(d @ ((np.array(ENDS[n]) - START) / np.linalg.norm(np.array(ENDS[n]) - START))))


def main() -> int:
    """Print the rows."""
    patterns = train_patterns(demonstrations(20, seed=1))
    shares = (0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
    right = dict.fromkeys(shares, 0)
    peer_right = dict.fromkeys(shares, 0)
    wrong = decided = 0
    delays, spent, frames = [], 0.0, 0
    rng = np.random.default_rng(2025)
    for name in ENDS:
        for _ in range(REACHES):
            recogniser = Recogniser(patterns)
            stamps, positions, onset, duration = reach(name, rng)
            pending, last, was_wrong = list(shares), UNKNOWN, False
            for t, p in zip(stamps, positions, strict=False):
                begin = time.perf_counter()
                estimate = recogniser.update(t, p)
                spent, frames = spent + time.perf_counter() - begin, frames + 1
                while pending and t >= onset + pending[0] * duration:
                    share = pending.pop(0)
                    right[share] += estimate.pattern == name
                    peer_right[share] += nearest_direction(p - positions[0]) == name
                if estimate.decided and last == UNKNOWN:
                    delays.append((t - onset) / duration)
                if estimate.decided and estimate.pattern != last:
                    was_wrong |= estimate.pattern != name
                    last = estimate.pattern
            wrong += was_wrong
            decided += last != UNKNOWN
    n = REACHES * len(ENDS)
    rows = [
        row(
            f"right after {share:.0%} of the reach",
            right[share] / n,
            "share",
            ">= 0.95" if share == 0.4 else "",
            share != 0.4 or right[share] / n >= 0.95,
            "nearest direction",
            peer_right[share] / n,
        )
        for share in shares
    ]
    rows.append(row("reaches with a wrong decision", wrong / n, "share", "<= 0.01", wrong / n <= 0.01))
    rows.append(row("reaches decided", decided / n, "share"))
    rows.append(row("decided after, median", float(np.median(delays)), "share of the reach"))
    rows.append(row("time per frame, four models", spent / frames * 1e6, "us", "<= 5000", spent / frames <= 5e-3))
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
