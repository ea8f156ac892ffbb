#!/usr/bin/env python3
"""Grasps by friction: five objects x five directions of the palm, shaken at 5 m/s^2 along three axes, and let go.

One trial each, every one has a row. Slip: farthest that the middle of the object comes from its place in the palm, in
3 s of shaking at 3 Hz; an object that is lost misses its row. Released: from the command to open until the hand holds
it no more; never within 1 s is infinitely late.
"""

import json
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PACKAGE / "test"))
from grasp_trial import DIRECTIONS, GraspTrial, objects  # noqa: E402

SLIP, RELEASE = 3.0, 0.3


def row(figure: str, value: float, unit: str, limit: float, fine: bool) -> dict[str, object]:
    """A figure that is fine up to `limit`."""
    return {
        "bench": "grasp",
        "figure": figure,
        "value": round(value, 3),
        "unit": unit,
        "goal": f"<= {limit:g}",
        "peer": None,
        "peer_value": None,
        "ok": fine and value <= limit,
    }


def main() -> None:
    rows = []
    for name, thing in objects().items():
        outcomes = {direction: GraspTrial(thing, direction).run() for direction in DIRECTIONS}
        for direction, outcome in outcomes.items():
            rows.append(
                row(f"{name}, {direction}: slip under 5 m/s^2", 1e3 * outcome.slip, "mm", SLIP, not outcome.lost)
            )
        slowest = max(outcomes.values(), key=lambda o: o.released)
        rows.append(
            row(f"{name}: released after opening, slowest of five directions", slowest.released, "s", RELEASE, True)
        )
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
