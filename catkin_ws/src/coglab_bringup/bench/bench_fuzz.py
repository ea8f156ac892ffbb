#!/usr/bin/python3
"""Figure `fuzz`: the whole system under 1e5 random messages on every topic and service of every node of ours.

The generator (coglab_bringup/ros_fuzz.py says what it sends) makes each message malformed by design: at least one value
that its definition excludes; or, in every third one with a time, an odd stamp alone. Messages without any field that
could be so (`Trigger`, integers alone) are valid by nature and counted apart. Ended: a node whose process is another
one, or does not answer, afterwards. Silent: a topic on which a node of ours spoke within 2.5 s before, and within 3 s
afterwards did not. Moved: the farthest that a joint of the arm came from where it was, missed if the arm would not have
followed a motion at the end, or at any time before; where this computer was late, command mode was begun again.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from coglab_bringup.run_directory import free_port, run_environment

LEAST = 100_000
TEST = Path(__file__).resolve().parent.parent / "test" / "fuzz.test"


def main() -> int:
    """Runs the campaign and prints the rows."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        environment = run_environment(free_port(), Path(folder))
        environment.update(COGLAB_LONG="1", COGLAB_FUZZ_REPORT=str(report))
        subprocess.run(
            ["rostest", str(TEST)],  # its own time limit stands in the file
            env=environment,
            stdout=sys.stderr,
            timeout=1700,
            check=False,
        )
        if not report.is_file():
            sys.exit(f"{TEST.name} left no report; see its output above")
        found = json.loads(report.read_text())
    sent, what = found["sent"], f"{found['topics']} topics and {found['services']} services of {found['nodes']} nodes"
    refused = [*found["motion_refused"], *([] if found["motion_allowed"] else ["at the end"])]
    rows = [
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
    ]
    told = [
        ("times that this computer was late and command mode was begun again", found["computer_late"]),
        *((f"messages sent, {kind}, to {what}", count) for kind, count in sent.items()),
        (f"malformed requests answered with success: {json.dumps(found['accepted'])}", sum(found["accepted"].values())),
    ]

    def one(figure: str, value: float, unit: str, goal: str, ok: bool) -> dict:
        return dict(bench="fuzz", figure=figure, value=value, unit=unit, goal=goal, peer=None, peer_value=None, ok=ok)

    total = sum(sent.values())
    table = [one(figure, value, unit, f"<= {most:g}", value <= most) for figure, value, unit, most in rows]
    table.append(one("messages sent in all", total, "1", f">= {LEAST:g}", total >= LEAST))
    table += [one(figure, value, "1", "reported", True) for figure, value in told]
    print(json.dumps(table, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
