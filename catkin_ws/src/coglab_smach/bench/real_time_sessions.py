#!/usr/bin/python3
"""Whole-system sessions in real time, for bench_trials.py: the plain launch file, then receive, put, take, give.

As a program: real_time_sessions.py SEED runs one session and prints {action: outcome} as JSON. Needs coglab_bringup.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ORDER = ("exchange_human_to_robot", "put", "take", "exchange_robot_to_human")
SESSIONS = 5
SESSION_LIMIT = 400.0
"""s"""


def run_session(seed: int) -> dict[str, str]:
    """One launch, the four actions; 'success' or a sentence for each."""
    import os

    import rospy
    from coglab_bringup.demo import System, wait_for_master
    from coglab_bringup.handover import run_handover
    from coglab_bringup.run_directory import free_port, run_environment
    from coglab_bringup.trial_recorder import TrialRecorder

    home = Path(tempfile.mkdtemp(prefix="coglab-session-"))
    port = free_port()
    environment = run_environment(port, home)
    os.environ.update(environment)
    arguments = [
        f"seed:={seed}",
        "fri_period:=0.010",
        "console:=false",
        "profile:=accustomed",
        "perfect_perception:=true",
    ]
    system = System(environment, port, arguments, home / "roslaunch.log")
    outcomes = {}
    try:
        wait_for_master(system, 30.0)
        rospy.init_node("coglab_session", anonymous=True, disable_signals=True)
        recorder = TrialRecorder()
        for action in ORDER:
            outcomes[action] = run_handover(action, "mug", recorder, system.alive)[0]["outcome"]
    except RuntimeError as error:
        outcomes[action if outcomes else ORDER[0]] = str(error)
    finally:
        system.stop()
    return outcomes


def session_rows(row) -> list[dict]:
    """Rows of SESSIONS sessions; ``row`` makes one."""
    good = dict.fromkeys(ORDER, 0)
    for seed in range(SESSIONS):
        try:
            done = subprocess.run(
                [sys.executable, __file__, str(seed + 1)],
                capture_output=True,
                text=True,
                timeout=SESSION_LIMIT,
                check=True,
            )
            outcomes = json.loads(done.stdout.splitlines()[-1])
        except (subprocess.SubprocessError, ValueError, IndexError) as error:
            print(f"session {seed + 1}: {error}", file=sys.stderr)
            continue
        for action in ORDER:
            outcome = outcomes.get(action, "not reached")
            good[action] += outcome == "success"
            if outcome != "success":
                print(f"session {seed + 1}, {action}: {outcome}", file=sys.stderr)
    return [
        row(
            f"{action}: whole system in real time, {SESSIONS} sessions, succeeded",
            good[action],
            "sessions",
            f">= {SESSIONS}",
            good[action] == SESSIONS,
        )
        for action in ORDER
    ]


if __name__ == "__main__":
    print(json.dumps(run_session(int(sys.argv[1]))))
