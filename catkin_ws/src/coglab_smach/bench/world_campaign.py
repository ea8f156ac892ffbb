#!/usr/bin/python3
"""The campaigns of the world (world_rows.py), or those of bench_partner, into a file, a trial of each row in turn, so
that all rows grow alike.

world_campaign.py FILE [--of partner] [--jobs N] [--seconds S]: goes on where FILE ends, until all is there, S seconds
are over or it is stopped (Ctrl-C, SIGTERM); about 2.2 s of a core a trial, at a low priority (nice).
world_campaign.py FILE [--of partner] --table: what FILE holds, as Markdown; what is fewer than asked is marked
incomplete and missed.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from pathlib import Path
from typing import Any

os.environ["COGLAB_LONG"] = "1"
import bench_partner
import campaign
import numpy as np
import partner_rows
import world_rows
from campaign import EXCHANGES, Campaign
from trial_file import TrialFile, commit_in, origin_in

COLUMNS = (
    "trials of asked",
    "receive",
    "give of all",
    "give of begun",
    "fell",
    "stuck",
    "outside a limit, commanded / measured",
    "palm off, receive",
    "palm off, give",
    "failures, receive",
    "failures, give",
)


def percent(share: float, of: int) -> str:
    """Or a dash where there was nothing."""
    return f"{100.0 * share:.0f} %" if of else "-"


def off(stood: list[dict[str, float]], never: list[dict[str, float]]) -> str:
    """Palm to the true goal pose where the arm stood; then how many reaches never did, and the same at their end."""
    return distances(stood) + (f"; never stood {len(never)}: {distances(never)}" if never else "")


def distances(found: list[dict[str, float]]) -> str:
    """Palm to the true goal pose: median (p95) in mm and deg."""
    if not found:
        return "-"
    parts = []
    for key, unit in (("truth_mm", "mm"), ("truth_deg", "deg")):
        values = [each[key] for each in found]
        parts.append(f"{np.median(values):.1f} ({np.percentile(values, 95):.1f}) {unit}")
    return ", ".join(parts)


def line(plan: world_rows.Plan) -> tuple[str, Campaign]:
    """One row of the table."""
    done = plan.run()
    receive, give = EXCHANGES
    cells = (
        f"{done.trials} of {done.asked}" + ("" if done.trials == done.asked else ", incomplete: missed"),
        percent(done.share(receive), done.trials),
        percent(done.share(give), done.trials),
        percent(done.share_of_begun(give), done.begun(give)),
        str(done.fell),
        str(done.stuck),
        f"{done.outside_commanded} / {done.outside_measured}",
        off(done.stood(receive), done.never_stood(receive)),
        off(done.stood(give), done.never_stood(give)),
        done.failures(receive),
        done.failures(give),
    )
    return f"| {plan.name} | {' | '.join(cells)} |", done


def judged(figure: str, value: float, unit: str, goal: str = "", ok: bool = True) -> dict[str, Any]:
    """A figure as a line of its own."""
    verdict = "" if ok and not goal else "met" if ok else "**missed**"
    print(f"| {figure} | {round(float(value), 4):g} {unit} | {goal} | {verdict} |")
    return {}


def origin() -> str:
    """Machine and date of the file's trials."""
    return origin_in(campaign.FILE.path) if campaign.FILE is not None else ""


def partner_table(commit: str) -> None:
    """The rows of bench_partner of what the file holds, as Markdown."""
    print(f"Sources: {commit}. {origin()}\n\n| figure | value | goal | |\n| --- | --- | --- | --- |")
    bench_partner.rows_of(judged, commit, partner_rows.groups(commit))


def table(commit: str) -> None:
    """Of what the file holds, as Markdown."""
    print(f"Sources: {commit}. {origin()}\n\n| campaign | {' | '.join(COLUMNS)} |\n| --- |{' --- |' * len(COLUMNS)}")
    everything = []
    for plan in world_rows.plans():
        text, done = line(plan)
        everything.append(done)
        print(text)
    print("\n| figure | value | goal | |\n| --- | --- | --- | --- |")
    world_rows.judged_rows(judged, [line(world_rows.physics_plan(name))[1] for name in world_rows.OBJECTS])
    world_rows.accustomed_rows(judged)
    speed = sum(each.virtual for each in everything) / max(1e-9, sum(each.processor for each in everything))
    row = world_rows.together(everything)[0].marked(judged)
    row("all campaigns: virtual time over processor time, one core", speed, "x", ">= 10", speed >= 10.0)
    world_rows.contact_rows(judged, world_rows.run_default())


def main() -> int:
    """Run or show."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="trials at a time (default: one a core)")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--of", choices=("world", "partner"), default="world", help="whose trials (default: the world)")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    try:
        campaign.FILE = TrialFile(options.file, commit_in(options.file) if options.table else None)
    except ValueError as error:
        sys.exit(f"error: {error}")
    of_partner, commit = options.of == "partner", campaign.FILE.commit
    if options.table:
        campaign.RUN_MISSING = False
        partner_table(commit) if of_partner else table(commit)
        return 0
    rows = list(partner_rows.groups(commit).values()) if of_partner else [plan.jobs() for plan in world_rows.plans()]
    jobs = campaign.in_turn(rows)
    os.nice(10)  # whatever else runs goes first
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        campaign.fill(jobs, max(1, options.jobs), options.seconds)
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
    done = sum(job.key in campaign.FILE.known for job in jobs)
    print(f"{done} of {len(jobs)} trials are in {options.file}")
    return 0 if done == len(jobs) else 1


if __name__ == "__main__":
    sys.exit(main())
