#!/usr/bin/python3
"""Wall times a newcomer meets: the first demo and the whole test run as recorded, a later demo and a new motion as run
here.

One run each. The first is the sum of installation, build and demo of this checkout; where a part was not done here, on
a machine that had it already, the row has no value and is missed. `docker/prove_bare` does it on a bare machine. The
new motion is that of coglab_controllers/test/test_new_motion.py: made by `controller new --motion`, built in a
workspace of its own, and done when its rostest has seen the simulated arm move. A test that fails gives no value. What
tests of combined conditions add to the whole test run: the programs named in COMBINED, whole, each with its part of the
wall time (two run beside each other, rostests alone); without a record of every one of them the row is missed.
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
        "test_robot_start.py",
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
COMBINED_LIMIT = 45.0  # s


def program_of(package: str, name: str) -> str:
    """As ./coglab test records it."""
    return f"{package}/{name if '.' in name else f'{package}_test_{name}'}"


def combined(times: dict) -> tuple[str, float | None]:
    """What the tests of combined conditions added to the last whole test run, and in words which of them took most."""
    wanted = [program_of(package, name) for package, names in COMBINED.items() for name in names]
    recorded = times.get("last_test", {}).get("programs", {})
    known = {name: recorded[name] for name in wanted if name in recorded}
    longest = sorted(known, key=lambda name: -known[name])[:3]
    words = ", ".join(f"{name} {known[name]:.0f} s" for name in longest) or "no record"
    figure = f"what {len(wanted)} programs of combined conditions add to ./coglab test (most: {words})"
    return figure, round(sum(known.values()), 1) if len(known) == len(wanted) else None


def row(figure: str, value: float | None, limit: float) -> dict:
    """A row whose goal is an upper limit in s; a figure that was not measured is missed."""
    fine = value is not None and value <= limit
    return dict(
        bench="wall", figure=figure, value=value, unit="s", goal=f"<= {limit:.0f}", peer=None, peer_value=None, ok=fine
    )


def first_demo(times: dict) -> tuple[str, float | None]:
    """What installing, building and the first demo of this checkout took together, and in words what is known of it.

    Each part as it was measured when it was done, whichever command did it. A checkout where a part was not done, as on
    a machine that had the packages already, has no such figure.
    """
    setup, demo = times.get("setup", {}), times.get("first_demo", {})
    parts = {
        "installation": setup.get("install_s") or None,
        "build": setup.get("build_s") or None,
        "first demo": demo.get("run_s") or None,
    }
    known = ", ".join(f"{name} {f'{value:.0f} s' if value else 'not measured here'}" for name, value in parts.items())
    value = sum(parts.values()) if all(parts.values()) else None
    return f"installation, build and first demo of this checkout ({known})", value


def new_motion(output: str) -> float | None:
    """Seconds that the test of a new motion has printed; None if it did not come so far."""
    said = re.search(r"to an arm that has moved: ([\d.]+) s", output)
    return float(said.group(1)) if said and re.search(r"\b1 passed", output) else None


def main() -> None:
    top = Path(os.environ["COGLAB_TOP"])
    recorded = top / ".coglab" / "times.json"
    times = json.loads(recorded.read_text()) if recorded.is_file() else {}
    figure, first = first_demo(times)
    with tempfile.TemporaryDirectory() as out:
        start = time.monotonic()
        subprocess.run([top / "coglab", "demo", "--headless", "--out", out], stdout=subprocess.DEVNULL, check=True)
        later = round(time.monotonic() - start, 1)
    test = [sys.executable, "-m", "pytest", "-s", "-q", "-p", "no:cacheprovider", "-k", "is_built_tested_and_moves"]
    made = subprocess.run(
        [*test, top / "catkin_ws/src/coglab_controllers/test/test_new_motion.py"], stdout=subprocess.PIPE, text=True
    )
    rows = [
        row(figure, first and round(first, 1), 300),
        row("demo again, run by this bench", later, 60),
        row("from controller new --motion to a simulated arm that has moved", new_motion(made.stdout), 90),
        row(
            "./coglab test of all packages, as last run in this checkout",
            times.get("last_test", {}).get("total_s"),
            900,
        ),
        row(*combined(times), COMBINED_LIMIT),
    ]
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
