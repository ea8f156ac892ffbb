#!/usr/bin/python3
"""Figure `goal_gate`: what one wrong goal frame, silence and stamps from the future do to a reach.

Each run is a reach in virtual time through the tf listener, the tf source, the gate, the estimator, the DMP and the
inverse kinematics. The clocks of the samples, of ROS and of the tracker drift apart by up to 100 ppm, and each reading
of a clock takes a random moment (one in a hundred: 0.3 ms on average). The hand moves, its frames have 2 mm of noise.
Followed: in any cycle after the disturbance the goal that the motion follows is more than 0.1 m away from the last
correct frame; a motion that was aborted follows nothing any more. Ignored: a correct frame, newest at a poll, that was
not the goal, or that the motion was held during; one that was never the newest at a poll is no correct frame here.
Beside it: the same runs with frames told apart by the time they map to on the clock of the samples. None of the 200
runs of a row is left out.
"""

from __future__ import annotations

import json
import subprocess
import sys

from bench_cycle import HERE, find
from core_bench import row

RUNS = 200


def main() -> int:
    """Runs the campaign and prints the rows."""
    output = subprocess.run(
        [find("coglab_controllers_goal_gate_bench"), str(HERE), str(HERE.parent / "lwr_description"), str(RUNS)],
        stdout=subprocess.PIPE,
        timeout=1500,
        check=True,
        text=True,
    ).stdout
    result = json.loads(output)
    rows = [
        row(
            "goal_gate",
            f"one outlier of 0.5 m at {one['rate']:.0f} Hz, then "
            f"{'silence' if one['silence'] else 'correct frames'}: motions that followed it, of {RUNS}",
            one["followed"],
            "1",
            "<= 0",
            "frames told apart by mapped times",
            one["mapped"],
        )
        for one in result["outlier"]
    ]
    future = result["future"]
    ahead = "5 frames 0.06 to 4e9 s ahead of the clock among correct ones at 30 Hz"
    rows += [
        row(
            "goal_gate",
            f"{ahead}: motions that followed one, of {RUNS}",
            future["followed"],
            "1",
            "<= 0",
        ),
        row(
            "goal_gate",
            f"{ahead}: correct frames ignored, of {future['correct']} in {RUNS} motions",
            future["ignored"],
            "1",
            "<= 0",
        ),
    ]
    json.dump(rows, sys.stdout, indent=1)
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
