#!/usr/bin/python3
"""Wall times a newcomer meets: the first demo and the whole test run as recorded, a later demo and a new motion as run
here.

One run each. The first is one command that installed the packages that were missing (how many of how many stands
beside it), built this checkout where nothing was built before, without a compiler's cache, and ran its first demo.
Where no command did all three, as on a machine that had a part already, the row has no value and is missed; later
demos, that of this bench too, and later builds are never taken for it. `docker/prove_bare` does it on a bare machine.
The new motion is that of coglab_controllers/test/test_new_motion.py: made by `controller new --motion`, built in a
workspace of its own, and done when its rostest has seen the simulated arm move. A test that fails gives no value. What
tests of combined conditions, and those that came with the simulated world, add to the whole test run: the programs
named in COMBINED and in WORLD, whole, each with its part of the wall time (programs that run beside each other share it
equally, at every moment); without a record of every one of them the row is missed. Times that ./coglab demo and
./coglab test have left are those of the sources that they say: of others, of sources that were not committed or changed
meanwhile, and where git knows nothing, they are not measured on these, and their rows are missed. final_error_mm is
what the demo of this bench leaves in its result.json for each direction: palm to the true grasp pose at the end of the
last reach.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from coglab_bringup.demo import KINDS
from coglab_bringup.sources import wall_sources

COMBINED = {
    # losses with limits, leash and feedback; what ends command mode; stamps, sizes and numbers that nobody expects
    "lwr_fri_bridge": (
        "losses",
        "bridge_faults",
        "command_mode_loss",
        "reason_codes",
        "target_command",
        "test_loss_rows.py",
    ),
    # cancel, faults and goals on a real clock; loading that fails half way
    "coglab_controllers": (
        "abi",
        "cancel",
        "control_thread",
        "faults",
        "goal_path",
        "limits_combined",
        "limits_under_loss",
        "test_robot_start.py",
        "test_robot_topics.py",
        "test_start_failure.py",
    ),
    "ctrl_more": ("abi", "all_or_nothing", "controller_logs", "test_address_sanitizer.py"),
    "ih2_hand": ("test_lost_port.py",),
    "coglab_sim": ("test_sanitizers.py", "test_limit_switches.py", "test_plausible.py"),
    # ports and their doubles, motions that are owned, another engine
    "coglab_smach": (
        "port_contracts.test",
        "test_port_contracts.py",
        "test_impossible_stamps.py",
        "test_motion_ownership.py",
        "test_master_state.py",
        "test_service_call.py",
        "test_other_engine.py",
        "test_virtual_reduced_limits.py",
        "test_virtual_slow_primitive.py",
    ),
    # random messages, printed lines, what a command leaves behind
    "coglab_bringup": (
        "fuzz.test",
        "test_ask.py",
        "test_bench.py",
        "test_docker.py",
        "test_printed_elsewhere.py",
        "test_printed_lines.py",
        "test_process_tree.py",
        "test_usage.py",
    ),
    "coglab_objects": ("test_object_database_node.py",),
}
"""programs by package: file names of Python tests and rostests, gtests without `PACKAGE_test_`"""
WORLD = {
    # physics, people, tracker, recordings, and how a cell ends
    "coglab_sim": (
        "plant_check",
        "plant_terms",
        "servos",
        "touch_signal",
        "recorded_hand.test",
        "test_another_object.py",
        "test_cell_launch.py",
        "test_check_person.py",
        "test_limits_as_measured.py",
        "test_object_without_database.py",
        "test_people_page.py",
        "test_plant.py",
        "test_plant_hands.py",
        "test_plant_refusals.py",
        "test_random_velocities.py",
        "test_senses.py",
        "test_tracker.py",
        "test_virtual_world.py",
    ),
    # samples of the campaigns
    "coglab_smach": ("test_recorded_handover.py", "test_world_sample.py"),
    "coglab_controllers": ("touch",),
    "ih2_hand": ("test_physical_motor.py",),
}
"""as COMBINED: programs that came with the simulated world; those that were there before and changed with it are not"""
ADDED_LIMIT = 45.0  # s, of each of both


def program_of(package: str, name: str) -> str:
    """As ./coglab test records it."""
    return f"{package}/{name if '.' in name else f'{package}_test_{name}'}"


def added(times: dict, programs: dict[str, tuple[str, ...]], what: str) -> tuple[str, float | None]:
    """What these programs added to the last whole test run, and in words which of them took most."""
    wanted = [program_of(package, name) for package, names in programs.items() for name in names]
    recorded = times.get("last_test", {}).get("programs", {})
    known = {name: recorded[name] for name in wanted if name in recorded}
    longest = sorted(known, key=lambda name: -known[name])[:3]
    words = ", ".join(f"{name} {known[name]:.0f} s" for name in longest) or "no record"
    figure = f"what {len(wanted)} programs of {what} add to ./coglab test (most: {words})"
    return figure, round(sum(known.values()), 1) if len(known) == len(wanted) else None


def row(figure: str, value: float | None, limit: float) -> dict:
    """A row whose goal is an upper limit in s; a figure that was not measured is missed."""
    fine = value is not None and value <= limit
    return dict(
        bench="wall", figure=figure, value=value, unit="s", goal=f"<= {limit:.0f}", peer=None, peer_value=None, ok=fine
    )


def of_sources(times: dict, now: str) -> dict:
    """Of the recorded times those that were measured on the sources as they are now; none where these have no word."""
    return {name: run for name, run in times.items() if now and run.get("sources") == now}


def whole_test(times: dict) -> float | None:
    """What the last run of all tests took."""
    return times.get("last_test", {}).get("total_s")


def first_demo(times: dict) -> tuple[str, float | None]:
    """What the one command took that installed, built and ran the first demo of this checkout, and in words its parts.

    A checkout that no single command has set up, as on a machine that had the packages already, has no such figure.
    """
    demo = times.get("demo_from_nothing", {})
    parts = {"installation": "install_s", "build": "build_s", "first demo": "run_s"}
    found = {name: demo.get(key) or None for name, key in parts.items()}
    known = ", ".join(f"{name} {f'{value:.0f} s' if value else 'not measured here'}" for name, value in found.items())
    if demo.get("installed"):
        known += f"; {demo['installed']} packages installed"
    value = sum(found.values()) if all(found.values()) else None
    return f"installation, build and first demo of this checkout, in one command ({known})", value


def new_motion(output: str) -> float | None:
    """Seconds that the test of a new motion has printed; None if it did not come so far."""
    said = re.search(r"to an arm that has moved: ([\d.]+) s", output)
    return float(said.group(1)) if said and re.search(r"\b1 passed", output) else None


def final_errors(result: dict) -> list[dict]:
    """A row for each direction of the demo: palm to the true grasp pose at the end of its last reach, mm, by the cell's
    truth and without a goal; missed where nobody has measured it, or where that handover did not take place."""
    found = {handover.get("kind"): handover for handover in result.get("handovers", [])}
    rows = []
    for kind in KINDS:
        value, by = (found.get(kind, {}).get(key) for key in ("final_error_mm", "final_error_by"))
        figure = (
            f"final_error_mm of the demo, {kind}, seed {result.get('seed')} (by {by or 'nobody: it did not begin'})"
        )
        told = dict.fromkeys(("peer", "peer_value")) | {"unit": "mm", "goal": "reported", "ok": value is not None}
        rows.append({"bench": "wall", "figure": figure, "value": value, **told})
    return rows


def main() -> None:
    top = Path(os.environ["COGLAB_TOP"])
    recorded = top / ".coglab" / "times.json"
    times = of_sources(json.loads(recorded.read_text()) if recorded.is_file() else {}, wall_sources(top))
    figure, first = first_demo(times)
    with tempfile.TemporaryDirectory() as out:
        start = time.monotonic()
        subprocess.run([top / "coglab", "demo", "--headless", "--out", out], stdout=subprocess.DEVNULL, check=True)
        later = round(time.monotonic() - start, 1)
        result = json.loads((Path(out) / "result.json").read_text())
    test = [sys.executable, "-m", "pytest", "-s", "-q", "-p", "no:cacheprovider", "-k", "is_built_tested_and_moves"]
    made = subprocess.run(
        [*test, top / "catkin_ws/src/coglab_controllers/test/test_new_motion.py"], stdout=subprocess.PIPE, text=True
    )
    rows = [
        row(figure, first and round(first, 1), 300),
        row("demo again, run by this bench", later, 60),
        row("from controller new --motion to a simulated arm that has moved", new_motion(made.stdout), 90),
        row("./coglab test of all packages, as last run in this checkout", whole_test(times), 900),
        row(*added(times, COMBINED, "combined conditions"), ADDED_LIMIT),
        row(*added(times, WORLD, "the simulated world"), ADDED_LIMIT),
        *final_errors(result),
    ]
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
