#!/usr/bin/python3
"""The campaigns of the world (world_rows.py) into a file, a trial of each row in turn, so that all rows grow alike.

world_campaign.py FILE [--processes N] [--seconds S]: goes on where FILE ends, until all is there or S seconds are over.
world_campaign.py FILE --rows: the figures of what FILE holds; what is fewer than asked is marked incomplete and missed.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

os.environ["COGLAB_LONG"] = "1"
import campaign
import world_rows
from trial_file import TrialFile


def show(figure: str, value: float, unit: str, goal: str = "", ok: bool = True, **_: Any) -> dict[str, Any]:
    """One line of a Markdown table."""
    verdict = "" if ok and not goal else "ok" if ok else "**missed**"
    print(f"| {figure} | {round(float(value), 4):g} {unit} | {goal} | {verdict} |", flush=True)
    return {"figure": figure, "value": value, "unit": unit, "goal": goal, "ok": ok}


def rows() -> None:
    """Of what the file holds."""
    campaign.RUN_MISSING = False
    print("| figure | value | goal | |\n| --- | --- | --- | --- |")
    default = world_rows.run_default()
    world_rows.physics_rows(show)
    world_rows.world_rows(show, default)
    world_rows.contact_rows(show, default)


def main() -> int:
    """Run or show."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--rows", action="store_true")
    options = parser.parse_args()
    try:
        campaign.FILE = TrialFile(options.file)
    except ValueError as error:
        sys.exit(f"error: {error}")
    if options.rows:
        rows()
        return 0
    jobs = campaign.in_turn([plan.jobs() for plan in world_rows.plans()])
    done = campaign.fill(jobs, options.processes, options.seconds)
    print(f"{done} of {len(jobs)} trials are in {options.file}")
    return 0 if done == len(jobs) else 1


if __name__ == "__main__":
    sys.exit(main())
