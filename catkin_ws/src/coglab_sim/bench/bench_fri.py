#!/usr/bin/python3
"""Software limit switches of the simulated robot controller while datagrams are lost, counted where they are judged.

Bridge and stand-in in lockstep, without ROS: one joint at a time goes to an end of its range at full speed, at 1, 2, 5
and 20 ms, with 0, 1, 5 and 10 % of the cycles lost, one at a time and in bursts of 1 to 5; half lose the measurement,
half the answer. A switch counts for each set-point beyond it, commanded or extrapolated by the stand-in. Nothing is
left out: an approach that ended command mode, or came not close to its end, makes its row missed. 14 seeds of each, a
sample, and 140 with --long. Prints JSON.
"""

from __future__ import annotations

import json
import os

from limit_approaches import Approach, Losses, approach

ASKED = 140  # seeds: each joint to each end, ten times
SEEDS = ASKED if os.environ.get("COGLAB_LONG") else 14
PERIODS = (0.001, 0.002, 0.005, 0.02)  # s
SHARES = (0.0, 0.01, 0.05, 0.10)


def row(period: float, found: list[Approach]) -> dict:
    """The row of one FRI period."""
    switches, failed = sum(one.limit_switches for one in found), sum(not one.arrived for one in found)
    figure = (
        f"software limit switches in the stand-in at {1e3 * period:g} ms, {len(found)} approaches at full speed with 0 "
        f"to 10 % loss ({failed} without an arrival)"
    )
    fine = switches == 0 and failed == 0
    of_seeds = {"done": SEEDS, "asked": ASKED}
    told = dict(bench="fri", figure=figure, value=switches, unit="1", goal="0", peer=None, peer_value=None, ok=fine)
    return told | of_seeds


def main() -> None:
    """Prints the rows."""
    kinds = [Losses(share, bursts) for share in SHARES for bursts in (False, True)]
    rows = [
        row(period, [approach(period, kind, seed) for kind in kinds for seed in range(SEEDS)]) for period in PERIODS
    ]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
