#!/usr/bin/python3
"""Figure `fuzz`: the system under 1e5 random messages on every topic and service of every node of ours, spread over its
three ways to start: one process for bridge and controller manager, two with the goal helper, and the ideal arm.

The generator (coglab_bringup/ros_fuzz.py says what it sends) makes each message malformed by design: at least one value
that its definition excludes; or, in every third one with a time, an odd stamp alone. Messages without any field that
could be so (`Trigger`, integers alone) are valid by nature, those that are odd only where their definition takes it are
allowed; both are counted apart. Ended: a node whose process is another one, or does not answer, afterwards. Silent: a
topic on which a node of ours spoke within 2.5 s before, and within 3 s afterwards did not. Moved: the farthest that a
joint of the arm came from where it was, missed if the arm would not have followed a motion at the end, or at any time
before; where this computer was late, command mode was begun again. Then the arm reaches slowly toward a goal that is
seen, beside more of them. Accepted: a malformed request answered with success, whichever service. A topic that follows
from the tree of frames may fall silent, since a valid transform can tear that.

Judge's rule made explicit (DOCUMENTED of coglab_bringup/fuzz_rules.py; the same messages are sent as before): these may
succeed because their srv file says so. `reason` of FeedbackSelect: any printable text of at most 200 bytes, odd as it
may read. `time_limit` and `reason` of CancelMotion: anything, since to end a motion is never refused. `timeout` of
InitVision, LocateObject and FreePlaces: any number. `object_id` of FreePlaces: any text. Before, every odd string
counted, and the services that take CancelMotion, InitVision, LocateObject or FreePlaces did not count at all.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from coglab_bringup.run_directory import free_port, run_environment

LEAST = 100_000
WAYS = ("one", "split", "ideal")
TEST = Path(__file__).resolve().parent.parent / "test" / "fuzz.test"


def campaign(way: str) -> dict:
    """What one way to start was found to be."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        environment = run_environment(free_port(), Path(folder))
        environment.update(COGLAB_LONG="1", COGLAB_FUZZ_REPORT=str(report), COGLAB_FUZZ_LAUNCH=way)
        subprocess.run(
            ["rostest", str(TEST)],  # its own time limit stands in the file
            env=environment,
            stdout=sys.stderr,
            timeout=1700,
            check=False,
        )
        if not report.is_file():
            sys.exit(f"{TEST.name} left no report of '{way}'; see its output above")
        return json.loads(report.read_text())


def row(figure: str, value: float, unit: str, goal: str, ok: bool) -> dict:
    """As every bench prints it."""
    return dict(bench="fuzz", figure=figure, value=value, unit=unit, goal=goal, peer=None, peer_value=None, ok=ok)


def rows_of(way: str, found: dict) -> list[dict]:
    """The figures of one way to start."""
    sent, what = found["sent"], f"{found['topics']} topics and {found['services']} services of {found['nodes']} nodes"
    refused = [*found["motion_refused"], *([] if found["motion_allowed"] else ["at the end"])]
    accepted, reach = found["accepted"], found["reach"]
    judged = [
        (f"nodes that ended: {', '.join(found['ended']) or 'none'}", len(found["ended"]), "1", 0),
        (f"topics that fell silent: {', '.join(found['silent']) or 'none'}", len(found["silent"]), "1", 0),
        (
            f"requests without an answer within 20 s (late, s: {found['late']}; lost: {found['lost']})",
            found["unanswered"],
            "1",
            0,
        ),
        ("the arm moved by", 1000.0 * found["moved"], "mrad", 10.0),
        (f"times at which it would have followed no motion: {'; '.join(refused) or 'none'}", len(refused), "1", 0),
        (f"callbacks that threw: {'; '.join(found['thrown']) or 'none'}", len(found["thrown"]), "1", 0),
        (f"malformed requests accepted: {json.dumps(accepted)}", sum(accepted.values()), "1", 0),
        ("largest share of a joint's speed limit in a reach beside it", reach["speed"], "1", 1.0),
    ]
    told = [
        (f"the reach ended as {' '.join(reach['states'])}, {1000.0 * reach['distance']:.1f} mm: code", reach["code"]),
        ("times that this computer was late and command mode was begun again", found["computer_late"]),
        *((f"messages sent, {kind}, to {what}", count) for kind, count in sent.items()),
    ]
    table = [
        row(f"{way}: {figure}", value, unit, f"<= {most:g}", value <= most) for figure, value, unit, most in judged
    ]
    return table + [row(f"{way}: {figure}", value, "1", "reported", True) for figure, value in told]


def main() -> int:
    """Runs the campaigns and prints the rows."""
    reports = {way: campaign(way) for way in WAYS}
    table = [each for way, found in reports.items() for each in rows_of(way, found)]
    total = sum(sum(found["sent"].values()) for found in reports.values())
    table.append(row("messages sent in all", total, "1", f">= {LEAST:g}", total >= LEAST))
    print(json.dumps(table, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
