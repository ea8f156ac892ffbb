#!/usr/bin/python3
"""The simulated cell: time of a step, load of the node, dynamics of the plant against KDL's and of the controller's
model against another MuJoCo's, a blocked arm, lockstep. Prints JSON rows only.

Definitions, nothing is left out. Step: 40 blocks of 2000 steps, the cell and mj_step alone on the same states; median
of the blocks' ratios, missed if a block has fewer than four contacts. Node: processor time over 10 s. Differences:
the largest element over all states. Blocked arm: the largest speed of any joint after the release, over two motions
and three FRI periods. Lockstep: every datagram of two runs with one seed, byte by byte.
"""

import json
import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PACKAGE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PACKAGE / "test"))
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
BLOCKS, STEPS = 40, 2000
MUG = "{start: robot_hand, position: [0.04, -0.05, 0.0], rotation: [-0.5, -0.5, -0.5, 0.5]}"
"""across the palm"""


def built(program: str) -> str:
    """Path of a program in the devel or install space on CMAKE_PREFIX_PATH; empty if it is not there."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "lib" / "coglab_sim" / program
        if path.is_file():
            return str(path)
    return ""


def output_of(program: str, *arguments: str) -> str:
    """What a program of this package prints."""
    path = built(program)
    if not path:
        sys.exit(f"{program} not found: build the package and source its setup.bash first")
    run = subprocess.run([path, *arguments], check=True, capture_output=True, text=True, timeout=600)
    return run.stdout


def equality() -> float | None:
    """Largest relative difference to MuJoCo over 1000 random states; None without the oracle."""
    try:
        import mujoco  # noqa: F401
    except ImportError:
        return None
    from coglab_sim import _cell
    from test_dynamics_oracle import Oracle

    oracle, random, worst = Oracle(), np.random.default_rng(1), 0.0
    for _ in range(1000):
        position, velocity = random.uniform(-2.0, 2.0, 7), random.uniform(-2.0, 2.0, 7)
        theirs, ours = oracle.terms(position, velocity), _cell.arm_terms(str(URDF), position, velocity)
        for name in ("mass", "gravity", "coriolis", "jacobian"):
            scale = max(1.0, np.abs(theirs[name]).max())
            worst = max(worst, np.abs(ours[name] - theirs[name]).max() / scale)
    return float(worst)


def row(figure: str, value: float, unit: str, limit: float) -> dict[str, object]:
    """A figure without a peer; fine up to `limit`."""
    return {
        "bench": "dynamics",
        "figure": figure,
        "value": value,
        "unit": unit,
        "goal": f"<= {limit:g}",
        "peer": None,
        "peer_value": None,
        "ok": value <= limit,
    }


def blocked_rows() -> list[dict[str, object]]:
    """Bridge and cell: the moving arm is held for 5 s and released; worst of two motions and three periods."""
    from wire import BLOCKED_MODES, BLOCKED_MOTIONS, Wire, speed_after_block

    return [
        row(
            f"{mode}: peak speed after 5 s against a block",
            round(
                max(
                    speed_after_block(Wire(krc__period=period), mode, moving)
                    for moving in BLOCKED_MOTIONS
                    for period in (0.001, 0.005, 0.02)
                ),
                5,
            ),
            "rad/s",
            0.1,
        )
        for mode in BLOCKED_MODES
    ]


def lockstep_row() -> dict[str, object]:
    """Two runs with the same seed, byte by byte."""
    from wire import lockstep_bytes

    periods = 3000
    first, second = lockstep_bytes(6, periods), lockstep_bytes(6, periods)
    different = sum(a != b for a, b in zip(first, second, strict=True))
    return row(f"lockstep: datagrams that differ between two runs of {periods} periods", different, "datagrams", 0)


def step_rows() -> list[dict[str, object]]:
    """A complete step of the cell beside MuJoCo alone on the same model and states, in the same blocks."""
    lines = output_of("coglab_sim_bench_cell", str(URDF), str(BLOCKS), str(STEPS)).splitlines()
    cell, mujoco, terms, contacts = zip(*([float(word) for word in line.split()] for line in lines), strict=True)
    ratio = statistics.median(a / b for a, b in zip(cell, mujoco, strict=True))
    figure = f"1 ms step of the cell over mj_step, median ratio, at least {min(contacts):.0f} contacts"
    return [
        {
            "bench": "dynamics",
            "figure": figure,
            "value": round(ratio, 3),
            "unit": "ratio",
            "goal": "<= 1.3",
            "peer": "mj_step alone, us",
            "peer_value": round(statistics.median(mujoco) * 1e-3, 2),
            "ok": ratio <= 1.3 and min(contacts) >= 4,
        },
        {
            "bench": "dynamics",
            "figure": "1 ms step of the cell, median processor time",
            "value": round(statistics.median(cell) * 1e-3, 2),
            "unit": "us",
            "goal": "reported",
            "peer": "KDL terms of the controller alone",
            "peer_value": round(statistics.median(terms) * 1e-3, 2),
            "ok": True,
        },
    ]


def missed(figure: str, goal: str, reason: str) -> dict[str, object]:
    """The row of a figure that could not be measured."""
    return {
        "bench": "dynamics",
        "figure": f"{figure}: not measured, {reason}",
        "value": None,
        "unit": "",
        "goal": goal,
        "peer": None,
        "peer_value": None,
        "ok": False,
    }


def kdl_rows() -> list[dict[str, object]]:
    """The plant with all its fingers beside a tree of KDL, 100 random states; missed if the test is not built."""
    program = "coglab_sim_test_plant_terms"
    reason, found = f"{program} did not print it", {}
    if built(program):
        found = dict(re.findall(r"(?:difference to KDL:|  )\s*(M|C\+g|g|J) (\S+)", output_of(program)))
    else:
        reason = f"{program} is not built (./coglab test coglab_sim)"
    rows = []
    for name in ("M", "C+g", "g", "J"):
        figure = f"{name} of the plant against KDL, 100 random states, largest difference"
        rows.append(
            row(figure, float(found[name]), "SI", 1e-6) if name in found else missed(figure, "<= 1e-06", reason)
        )
    return rows


def processor_time(pid: int) -> float:
    """s that a process has used so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def real_time_rows() -> list[dict[str, object]]:
    """Load of the node /coglab_sim/cell with a mug in its closed hand, answered every 5 ms."""
    from coglab_bringup.run_directory import free_port, run_environment
    from fri_client import Client

    port, processes = free_port(), []
    bridge = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bridge.bind(("127.0.0.1", 0))
    bridge.settimeout(30.0)
    command = "{speed: [1, 1, 1, 1, 1], target: [0.96, 1, 1, 1, 1], current: [240, 240, 240, 240, 240]}"
    cell = [built("cell_node"), "__ns:=/coglab_sim", f"_fri_port:={bridge.getsockname()[1]}", "_krc/period:=0.005"]
    hand = ["rostopic", "pub", "-r", "50", "/coglab_sim/motor_commands", "coglab_msgs/MotorCommands", command]
    with tempfile.TemporaryDirectory() as folder:
        environment = run_environment(port, Path(folder))
        try:
            processes.append(subprocess.Popen(["roscore", "-p", str(port)], env=environment, stdout=sys.stderr))
            mug = ["rosparam", "set", "/coglab_sim/cell/object", MUG]
            online = time.monotonic() + 30.0
            while subprocess.run(mug, env=environment, stderr=subprocess.DEVNULL).returncode != 0:
                if time.monotonic() > online:
                    sys.exit("roscore does not answer within 30 s; see above")
            for words in (cell, hand):
                processes.append(subprocess.Popen(words, env=environment, stdout=sys.stderr))
            client = Client()
            used = [0.0, 0.0]
            for i, seconds in enumerate((5.0, 10.0)):  # the first while it closes
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    data, peer = bridge.recvfrom(2048)
                    bridge.sendto(client.answer(data), peer)
                used[i] = processor_time(processes[1].pid)
            load = 100.0 * (used[1] - used[0]) / 10.0
        finally:
            for process in reversed(processes):
                process.terminate()
                process.wait(20)
    return [row("node of the cell in real time, 5 ms period, mug in its hand", round(load, 1), "% of a core", 20.0)]


def main() -> None:
    rows = step_rows() + kdl_rows() + real_time_rows()
    difference = equality()
    figure = "M, C, g, J of the controller's model against another MuJoCo, 1000 states, largest"
    if difference is None:
        rows.append(missed(figure, "<= 1e-09", "mujoco-core is not installed (test-oracles.txt)"))
    else:
        rows.append(row(figure, difference, "relative", 1e-9))
    rows += blocked_rows() + [lockstep_row()]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
