#!/usr/bin/python3
"""Answer latency of the robot node against a bare echo, at 1 kHz, while its controller manager moves the arm.

The node is /robot as launched by default: FRI thread and controller manager in one process, a point-to-point motion
running to and fro. Blocks of 500 packets go to echo, bridge, bridge, echo; both are served in every millisecond, the
one whose block it is first. The ratio of the medians of neighbouring blocks is judged by its median over all pairs,
with the distribution-free 95 % interval of that median. The ratio of the 99th percentiles is shown beside the same
ratio of echo against echo: on a machine that is not a real-time one it says more about the machine. Prints JSON.

First, in lockstep and without ROS, limits and braking while datagrams are lost (docs/limits_under_loss.md).
"""

from __future__ import annotations

import json
import math
import os
import random
import signal
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path

QUADS = int(os.environ.get("COGLAB_BENCH_QUADS", "20"))
LIMIT = 1.10
PEER = "lwr_fri_bridge_latency_peer"
LOSSES = "lwr_fri_bridge_loss_campaign"
SEEDS = 1000 if os.environ.get("COGLAB_LONG") else 100  # 1000 take about 25 min
# s by FRI period: A2 from the middle of its range to 0.05 rad before its limit, measured at commit 5828bb3, which did
# not reckon with losses.
MOTION_TIMES = {0.001: 1.270, 0.002: 1.274, 0.005: 1.285, 0.02: 1.360}
MOTION_LIMIT = 1.1
STOP_LIMIT = 1.5
HOME = [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782]  # where the measuring peer stands
AWAY = [value + 0.25 for value in HOME]
PATIENCE = 60.0  # s, for each step of the start


def find_binary(name: str) -> str:
    """Path of a helper binary in the sourced workspace."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "lib" / "lwr_fri_bridge" / name
        if path.is_file():
            return str(path)
    sys.exit(f"{name} not found: build the workspace and source its setup.bash")


def end(process: subprocess.Popen, limit: float = 20.0) -> None:
    """Ends a process, kindly first."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=limit)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Motion:
    """Asks the node for command mode and for point-to-point motions to and fro, in a thread of its own."""

    def __init__(self) -> None:
        self.error = ""
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._over.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        try:
            self._move()
        except Exception as error:  # shown by main(); a bench that measures nothing must not look fine
            self.error = str(error)

    def _move(self) -> None:
        import rospy
        from coglab_msgs.msg import FinishedPtp
        from coglab_msgs.srv import AddPtp, LoadController, LwrCommand, SwitchController

        def call(name: str, kind: type, *arguments: object) -> object:
            rospy.wait_for_service(name, PATIENCE)
            return rospy.ServiceProxy(name, kind)(*arguments)

        finished: list[int] = []
        rospy.Subscriber("controller_manager/ptp/finished_ptp", FinishedPtp, lambda m: finished.append(m.ptp_id))
        deadline = time.monotonic() + PATIENCE
        steps = [
            ("controller_manager/load_controller", LoadController, ("ptp", "coglab/PtpController")),
            ("lwr/command", LwrCommand, ("start",)),
            ("controller_manager/switch_controller", SwitchController, ("ptp",)),
        ]
        for name, kind, arguments in steps:
            while True:  # the measuring peer comes a moment later
                answer = call(name, kind, *arguments)
                if answer.success:
                    break
                if time.monotonic() > deadline:
                    raise RuntimeError(f"{name} {arguments}: {answer.message}")
                time.sleep(0.2)
        target = AWAY
        while not self._over.is_set():
            answer = call("controller_manager/ptp/add_ptp", AddPtp, target, [], [])
            if not answer.success:
                if time.monotonic() > deadline:
                    raise RuntimeError(f"add_ptp: {answer.message}")
                time.sleep(0.2)
                continue
            target = HOME if target is AWAY else AWAY
            until = time.monotonic() + 20.0
            while answer.ptp_id not in finished and time.monotonic() < until and not self._over.is_set():
                time.sleep(0.02)


def percentile(values: list[float], part: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def median_interval(values: list[float]) -> tuple[float, float]:
    """95 % interval of the median from order statistics (normal approximation of the binomial)."""
    ordered = sorted(values)
    n = len(ordered)
    half = 1.96 * math.sqrt(n) / 2.0
    low = max(0, math.floor(n / 2.0 - half))
    high = min(n - 1, math.ceil(n / 2.0 + half) - 1)
    return ordered[low], ordered[high]


def bound_port() -> int:
    """UDP port of the node's bridge, once it is up."""
    import rospy

    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        port = rospy.get_param("/lwr/fri_port_bound", 0)
        if port:
            return int(port)
        time.sleep(0.1)
    sys.exit(f"the robot node published no UDP port within {PATIENCE:.0f} s")


def measure() -> tuple[list[tuple[str, list[float]]], float]:
    """Blocks (kind, latencies in us, -1 missing), and the share of answers that moved the arm."""
    master = random.randint(20000, 40000)
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{master}"
    binary = find_binary(PEER)
    launch = Path(__file__).resolve().parent / "fri.launch"
    processes = [subprocess.Popen(["roslaunch", "-p", str(master), str(launch)], stdout=sys.stderr)]
    motion = Motion()
    try:
        echo = subprocess.Popen([binary, "echo"], stdout=subprocess.PIPE, text=True)
        processes.append(echo)
        assert echo.stdout is not None
        echo_port = int(echo.stdout.readline())
        import rosgraph
        import rospy

        deadline = time.monotonic() + PATIENCE
        while not rosgraph.is_master_online():
            if time.monotonic() > deadline:
                sys.exit(f"no roscore within {PATIENCE:.0f} s")
            time.sleep(0.1)
        rospy.init_node("bench_fri", disable_signals=True)
        port = bound_port()
        motion.start()
        run = subprocess.run(
            [binary, "measure", str(echo_port), str(port), str(QUADS)],
            stdout=subprocess.PIPE,
            text=True,
            check=False,
            timeout=2 * PATIENCE + 10 * QUADS,
        )
        if run.returncode != 0:
            sys.exit(f"nothing measured: {motion.error or run.returncode}")
        motion.stop()
    finally:
        for process in reversed(processes):
            end(process)
    blocks, moving = [], 0.0
    for line in run.stdout.splitlines():
        kind, *values = line.split()
        if kind == "moving":
            moving = float(values[0])
        elif kind in ("echo", "bridge"):
            blocks.append((kind, [float(value) for value in values]))
    return blocks, moving


def row(
    figure: str,
    value: float,
    unit: str,
    goal: str = "reported",
    peer: str | None = None,
    peer_value: float | None = None,
    ok: bool = True,
) -> dict[str, object]:
    """A row as `./coglab bench` prints it."""
    return {
        "bench": "fri",
        "figure": figure,
        "value": round(value, 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": None if peer_value is None else round(peer_value, 4),
        "ok": ok,
    }


def loss_rows() -> list[dict[str, object]]:
    """Limits, times and braking while datagrams are lost: one figure per period."""
    run = subprocess.run([find_binary(LOSSES), str(SEEDS)], stdout=subprocess.PIPE, text=True, check=True, timeout=6000)
    lines = [line.split() for line in run.stdout.splitlines()]
    rows = []
    for period in MOTION_TIMES:
        approaches = [list(map(float, v[1:])) for v in lines if v[0] == "approach" and float(v[1]) == period]
        beyond, failed = max(v[2] for v in approaches), sum(v[5] + v[6] for v in approaches)
        above = max(max(v[3], v[4]) for v in approaches)
        at = f"at {1e3 * period:g} ms"
        rows.append(
            row(
                f"set-point beyond its bound {at}, {SEEDS} seeds x 0, 1, 5, 10 % loss x single, bursts x both "
                "kinds of controller",
                beyond,
                "mrad",
                "0",
                ok=beyond == 0.0 and failed == 0,
            )
        )
        rows.append(
            row(
                f"speed or acceleration beyond its limit {at}, the same runs",
                above,
                "rad/s, rad/s^2",
                "<= 1e-6",
                ok=above <= 1e-6,
            )
        )
    for period, before in MOTION_TIMES.items():
        time_now = next(float(v[2]) for v in lines if v[0] == "motion" and float(v[1]) == period)
        rows.append(
            row(
                f"full-speed motion of A2 to 0.05 rad before its limit at {1e3 * period:g} ms",
                time_now,
                "s",
                f"<= {MOTION_LIMIT:g} x before",
                "commit 5828bb3",
                before,
                time_now <= MOTION_LIMIT * before,
            )
        )
    for _, period, bursts, _, mean, worst in (v for v in lines if v[0] == "stop"):
        kind = "bursts of 1..5" if bursts == "1" else "single"
        what = f"angle of stopping at 10 % loss ({kind}) over that without, {1e3 * float(period):g} ms"
        rows.append(
            row(f"{what}, mean of {SEEDS}", float(mean), "ratio", f"<= {STOP_LIMIT:g}", ok=float(mean) <= STOP_LIMIT)
        )
        rows.append(row(f"{what}, largest", float(worst), "ratio"))
    return rows


def main() -> None:
    losses = loss_rows()
    blocks, moving = measure()
    answered = [(kind, [v for v in values if v >= 0.0]) for kind, values in blocks]
    medians = [statistics.median(values) for _, values in answered]
    p99s = [percentile(values, 0.99) for _, values in answered]
    ratios, p99_ratios, echo_p99_ratios = [], [], []
    for first in range(0, len(blocks), 4):  # echo, bridge, bridge, echo
        ratios += [medians[first + 1] / medians[first], medians[first + 2] / medians[first + 3]]
        p99_ratios += [p99s[first + 1] / p99s[first], p99s[first + 2] / p99s[first + 3]]
        echo_p99_ratios.append(p99s[first + 3] / p99s[first])
    low, high = median_interval(ratios)
    ratio = statistics.median(ratios)
    medians_of = {
        kind: statistics.median(m for (k, _), m in zip(answered, medians, strict=True) if k == kind)
        for kind in ("echo", "bridge")
    }
    missed = {kind: sum(v < 0.0 for k, values in blocks if k == kind for v in values) for kind in ("echo", "bridge")}

    print(
        json.dumps(
            [
                *losses,
                row(
                    f"answer latency, median of {len(ratios)} block ratios",
                    ratio,
                    "bridge/echo",
                    f"<= {LIMIT:.2f}, 95 % interval not above",
                    "bare echo",
                    1.0,
                    low <= LIMIT,
                ),
                row("answer latency ratio, 95 % interval, low end", low, "bridge/echo"),
                row("answer latency ratio, 95 % interval, high end", high, "bridge/echo"),
                row(
                    "answer latency, median",
                    medians_of["bridge"],
                    "us",
                    "",
                    "bare echo",
                    medians_of["echo"],
                ),
                row(
                    "answer latency, ratio of p99",
                    statistics.median(p99_ratios),
                    "bridge/echo",
                    "",
                    "echo/echo",
                    statistics.median(echo_p99_ratios),
                ),
                row(
                    "answers missing within 20 ms",
                    missed["bridge"],
                    "packets",
                    "",
                    "bare echo",
                    missed["echo"],
                ),
                row(
                    "answers that moved the arm: the controller's motion runs",
                    moving,
                    "share",
                    ">= 0.5",
                    ok=moving >= 0.5,
                ),
            ],
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
