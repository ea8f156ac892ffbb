#!/usr/bin/python3
"""Bench of recovery: nothing moves after a failed state.

A trial in virtual time (KRC stand-in, bridge, controller manager and hand emulator, with a person who is drawn by the
seed and the tracker with its noise, as by default) is struck at a seeded moment of every machine in turn
(initialisation, both exchanges, take, put, recovery) by a failure, a time limit or a preemption. It counts as moved if
the true speed of any joint of the simulated arm exceeds 0.02 rad/s between the moment at which the next state begins,
or at which the machine has ended, and the next motion that is asked for. A trial whose machine was over before its
moment had come is drawn again, and counted beside; 200 that were struck, or stuck, make the figure.
"""

import json
import multiprocessing
import os
import sys
from collections import Counter
from itertools import count, islice
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from seeded_failure import SeededFailure

STRUCK = 200


def one(seed):
    """One trial in a process of its own; plain data."""
    failure = SeededFailure(seed)
    try:
        moved = failure.run()
    except AssertionError as error:
        return {"seed": seed, "happened": failure.happened, "moved": failure.watch.moved, "stuck": str(error)}
    return {"seed": seed, "happened": failure.happened, "moved": failure.watch.moved if moved else [], "stuck": ""}


def row(figure, value, unit, goal, ok):
    """One row of the bench table."""
    return {
        "bench": "recovery",
        "figure": figure,
        "value": value,
        "unit": unit,
        "goal": goal,
        "peer": None,
        "peer_value": None,
        "ok": bool(ok),
    }


def main() -> int:
    """Print the rows."""
    struck, over = [], 0
    with multiprocessing.get_context("fork").Pool(os.cpu_count() or 1) as pool:
        for trial in pool.imap(one, islice(count(), 4 * STRUCK)):
            if trial["stuck"] and not trial["happened"]:
                print(f"seed {trial['seed']}: not struck: {trial['stuck']}", file=sys.stderr)
            over += not (trial["happened"] or trial["stuck"])
            if trial["happened"] or trial["stuck"]:
                struck.append(trial)
                for where, speed in trial["moved"][:1]:
                    print(
                        f"seed {trial['seed']}: {trial['happened']}: {speed:.3f} rad/s in {where or 'the end'}",
                        file=sys.stderr,
                    )
                if trial["stuck"]:
                    print(f"seed {trial['seed']}: {trial['happened']}: stuck: {trial['stuck']}", file=sys.stderr)
            if len(struck) == STRUCK:
                break
        pool.terminate()
    moved = [trial for trial in struck if trial["moved"]]
    stuck = sum(bool(trial["stuck"]) for trial in struck)
    kinds = Counter(trial["happened"].split(" in ")[0] for trial in struck)
    fastest = max((speed for trial in moved for _, speed in trial["moved"]), default=0.0)
    rows = [
        row(
            f"seeded failures ({', '.join(f'{n} by {kind}' for kind, n in sorted(kinds.items()) if kind)})",
            len(struck),
            "trials",
            f">= {STRUCK}",
            len(struck) >= STRUCK,
        ),
        row("left out: trials over before the moment of their failure, drawn again", over, "trials", "", True),
        row("the arm moves after a failed state", len(moved), "trials", "<= 0", not moved),
        row(
            "fastest joint where the arm moves after a failed state",
            round(fastest, 4),
            "rad/s",
            "<= 0.02",
            fastest <= 0.02,
        ),
        row("the machine is stuck after a seeded failure", stuck, "trials", "<= 0", stuck == 0),
    ]
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
