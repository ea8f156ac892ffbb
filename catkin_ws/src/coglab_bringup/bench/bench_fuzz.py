#!/usr/bin/python3
"""Figure `fuzz`: the system under 1e5 random messages on every topic and service of every node of ours, spread over its
three ways to start: one process for bridge and controller manager, two with the goal helper, and the ideal arm.

The generator (coglab_bringup/ros_fuzz.py says what it sends) makes each message malformed by design: at least one value
that its definition excludes; or, in every third one with a time, an odd stamp alone. Messages without any field that
could be so (`Trigger`, integers alone) are valid by nature, those that are odd only where their definition takes it are
allowed; both are counted apart. Ended: a node whose process is another one, or does not answer, afterwards. Silent: a
topic on which a node of ours spoke within 2.5 s before, and within 3 s afterwards did not. One that follows from the
tree of frames (dmp_goal of the goal helper) may, since a valid transform can tear that, if its node says why within
8 s: it is counted in a row of its own, with these words, and without them as every other. Moved: the farthest that a
joint of the arm came from where it was, missed if the arm would not have followed a motion at the end, or at any time
before; where this computer was late, command mode was begun again. Then the arm reaches slowly toward a goal that is
seen, beside more of them. Accepted: a malformed request answered with success, whichever service. Left out, and named
in a row: the service that ends everything (/coglab/stop), after which no motion would be followed, and beside the reach
those that may end it, whatever they are sent.

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
from collections.abc import Iterable
from pathlib import Path

from coglab_bringup.run_directory import free_port, run_environment

Figure = tuple[str, float, str, float | None]  # name, value, unit, the most that it may be; None: told alone
LEAST = 100_000
WAYS = {
    "one": "bridge and controller manager in one process",
    "split": "bridge and controller manager in two processes, with the goal helper",
    "ideal": "ideal arm",
}
"""the ways to start, by their names in the launch file"""
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


def listed(names: Iterable[str]) -> str:
    """What a row names."""
    return ", ".join(names) or "none"


def silence_rows(found: dict) -> list[Figure]:
    """What spoke before and did not afterwards: without a word of why, which is judged, and with one, which is told."""
    spoke, why = found["spoke"], [f"{topic} ({words})" for topic, words in found["explained"].items()]
    silent = f"topics that fell silent without a word of why, of {spoke} that spoke before: {listed(found['silent'])}"
    told = f"topics that fell silent for a reason that their node says, of {spoke} that spoke before: {listed(why)}"
    return [(silent, len(found["silent"]), "topics", 0.0), (told, len(why), "topics", None)]


def rows_of(way: str, found: dict) -> list[dict]:
    """The figures of one way to start."""
    sent, what = found["sent"], f"{found['topics']} topics and {found['services']} services of {found['nodes']} nodes"
    refused = [*found["motion_refused"], *([] if found["motion_allowed"] else ["at the end"])]
    accepted, reach = found["accepted"], found["reach"]
    asked = sum(found["answers"].values()) + len(found["lost"])
    unsent = f"{listed(found['left_out'])}; beside the reach alone {listed(found['spared'])}"
    figures: list[Figure] = [
        (f"nodes that ended, of {found['nodes']} nodes: {listed(found['ended'])}", len(found["ended"]), "nodes", 0.0),
        *silence_rows(found),
        (
            f"requests without an answer within 20 s, of {asked} requests (late, s: {found['late']}; lost: "
            f"{found['lost']})",
            found["unanswered"],
            "requests",
            0.0,
        ),
        ("farthest that a joint of the standing arm came from where it was", 1000.0 * found["moved"], "mrad", 10.0),
        (
            f"times at which the arm would have followed no motion: {'; '.join(refused) or 'none'}",
            len(refused),
            "times",
            0.0,
        ),
        (f"callbacks that threw: {'; '.join(found['thrown']) or 'none'}", len(found["thrown"]), "callbacks", 0.0),
        (
            f"malformed requests accepted, of {asked} requests: {json.dumps(accepted)}",
            sum(accepted.values()),
            "requests",
            0.0,
        ),
        ("largest share of a joint's speed limit in a reach beside random messages", reach["speed"], "1", 1.0),
        (
            f"reason code of the reach beside random messages, which ended as {' '.join(reach['states'])}, "
            f"{1000.0 * reach['distance']:.1f} mm from its goal",
            reach["code"],
            "1",
            None,
        ),
        ("times that this computer was late and command mode was begun again", found["computer_late"], "times", None),
        (f"services that got no message: {unsent}", len(found["left_out"]) + len(found["spared"]), "services", None),
        *((f"messages sent, {kind}, to {what}", count, "messages", None) for kind, count in sent.items()),
    ]
    return [
        row(f"{WAYS[way]}: {figure}", value, unit, "reported" if most is None else f"<= {most:g}",
            most is None or value <= most)
        for figure, value, unit, most in figures
    ]  # fmt: skip


def main() -> int:
    """Runs the campaigns and prints the rows."""
    reports = {way: campaign(way) for way in WAYS}
    table = [each for way, found in reports.items() for each in rows_of(way, found)]
    total = sum(sum(found["sent"].values()) for found in reports.values())
    table.append(row("messages sent in all three ways to start", total, "messages", f">= {LEAST:g}", total >= LEAST))
    print(json.dumps(table, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
