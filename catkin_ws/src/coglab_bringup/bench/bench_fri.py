#!/usr/bin/python3
"""Answer latency of the robot node against a bare echo, at 1 kHz: in monitor mode, while a motion and feedback run,
and with the console and one browser beside that.

The node is /robot as launched by default: FRI thread and controller manager in one process, with the shipped list of
feedback controllers, which are loaded and, as shipped, disabled: so they are in monitor mode. In the other two ways a
point-to-point motion runs to and fro, and the service feedback/enable has enabled all of them, in the list's order,
once the motion controller was active. No force acts on the hand. feedback/status and feedback/state are listened to
meanwhile, at 5 Hz: a controller ran if, at every look while the blocks were measured, it was `running` and had been
updated in the cycle looked at. How many ran stands in the names of the rows. Fewer than are loaded miss a row of their
own; with none, or fewer looks than rounds, every row of that way is missed.

Blocks of 500 packets go to echo, bridge, bridge, echo; both are served in every millisecond, the one whose block it is
first. The ratio of the medians of neighbouring blocks is judged by its median over all pairs and by the upper end of
the distribution-free 95 % interval of that median, whose ranks come from the exact binomial, so that it covers at least
that. An answer counts for the packet whose number it reflects alone. One that does not come within 20 ms counts as
20 ms; every packet that was sent is counted, also those beside the blocks of the echo and those sent while the motion
was waited for, and one without an answer makes the row of missing answers missed. 40 rounds of four blocks were asked
for; COGLAB_BENCH_QUADS takes fewer, which is a sample. The ratio of the 99th percentiles is shown beside the same ratio
of echo against echo: on a machine that is not a real-time one it says more about the machine. Prints JSON. The rows of
losses are in lwr_fri_bridge/bench/bench_fri.py.
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
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

ASKED = 40  # rounds of four blocks
QUADS = int(os.environ.get("COGLAB_BENCH_QUADS", ASKED))
PEER = "lwr_fri_bridge_latency_peer"
LIMIT = 1.10  # of the ratio
SHARE = 0.8  # of the answers that move the arm while its motion runs
MISSING = 20000.0  # us, what an answer that did not come within 20 ms counts
HOME = [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782]  # where the measuring peer stands
AWAY = [value + 0.25 for value in HOME]
PATIENCE = 60.0  # s, for each step of the start

Blocks = list[tuple[str, list[float]]]  # kind, and latencies in us, -1 missing
Counts = dict[str, list[int]]  # by kind: packets sent, without an answer, late datagrams, without before the blocks
Looks = list[list[str]]  # of each look while the blocks were measured, the feedback controllers that ran in its cycle


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


class Feedback:
    """Watches over ROS which feedback controllers run."""

    def __init__(self) -> None:
        self.activity: dict[str, str] = {}  # of each that is loaded, in execution order
        self.looks: Looks = []
        self._cycle = 0  # of the newest look

    def listen(self) -> None:
        """Subscribes to both topics; the node publishes what happened in a cycle only while somebody does."""
        import rospy
        from coglab_msgs.msg import FeedbackState, FeedbackStatus

        rospy.Subscriber("controller_manager/feedback/status", FeedbackStatus, self.take_status)
        rospy.Subscriber("controller_manager/feedback/state", FeedbackState, self.take_state)

    def take_status(self, message: object) -> None:
        """Which are loaded, and what each does."""
        self.activity = {controller.name: controller.activity for controller in message.controllers}

    def take_state(self, message: object) -> None:
        """One look. A cycle that was looked at before means that no update has come since: then none runs."""
        shown = [state.controller for state in message.states] if message.cycle > self._cycle else []
        self._cycle = message.cycle
        self.looks.append([name for name in shown if self.activity.get(name) == "running"])


def active(looks: Looks) -> list[str]:
    """The controllers that ran at every look. With fewer looks than rounds nothing is known, and none counts."""
    if len(looks) < QUADS or not looks:
        return []
    return [name for name in looks[0] if all(name in look for look in looks)]


class Motion:
    """Asks the node for command mode, feedback, and point-to-point motions to and fro, in a thread of its own."""

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
        from coglab_msgs.srv import AddPtp, FeedbackSelect, LoadController, LwrCommand, SwitchController

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
            # After the switch, which applies the profile of ptp: none. No name: all that are loaded.
            ("controller_manager/feedback/enable", FeedbackSelect, ([], "")),
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


def median_ranks(n: int) -> tuple[int, int]:
    """Ranks (from 1) of the order statistics between which the median lies with at least 95 %, by the exact binomial:
    the narrowest such pair, as many ranks from both ends. For n < 6 there is none, and the pair is the ends."""
    below = 0.0  # probability that fewer than `low` of n values are below the median, doubled later
    low = 1
    for k in range(n // 2):
        below += math.comb(n, k) / 2**n
        if 2.0 * below > 0.05:
            break
        low = k + 1
    return low, n + 1 - low


def median_interval(values: list[float]) -> tuple[float, float]:
    """95 % interval of the median from order statistics, whatever the distribution."""
    ordered = sorted(values)
    low, high = median_ranks(len(ordered))
    return ordered[low - 1], ordered[high - 1]


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


def open_console(stack: ExitStack, home: Path) -> None:
    """A console of this ROS master and a browser that shows it, until the stack is unwound."""
    from coglab_console.browser import Browser, fresh_link

    node = subprocess.Popen(["rosrun", "coglab_console", "console_node.py", "_port:=0"], stdout=sys.stderr)
    stack.callback(end, node)
    browser = stack.enter_context(Browser())
    browser.open(fresh_link(home, limit=PATIENCE), PATIENCE)


def measure(way: str) -> tuple[Blocks, float, Counts, list[str], Looks]:
    """Blocks, the share of answers that moved the arm, which is 0 in monitor mode, what became of all packets, the
    feedback controllers that are loaded, and the looks at them, of which there are none in monitor mode.

    The way is `monitor`, `moving`, or `console` (moving, with the console and one browser).
    """
    moving = way != "monitor"
    master = random.randint(20000, 40000)
    binary = find_binary(PEER)
    launch = Path(__file__).resolve().parent / "fri.launch"
    with ExitStack() as stack:
        home = stack.enter_context(tempfile.TemporaryDirectory(prefix="coglab-bench-", ignore_cleanup_errors=True))
        os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{master}", ROS_HOME=home, ROS_LOG_DIR=f"{home}/log")
        stack.callback(end, subprocess.Popen(["roslaunch", "-p", str(master), str(launch)], stdout=sys.stderr))
        echo = subprocess.Popen([binary, "echo"], stdout=subprocess.PIPE, text=True)
        stack.callback(end, echo)
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
        if way == "console":
            open_console(stack, Path(home))
        motion, feedback = Motion(), Feedback()
        if moving:
            feedback.listen()
            motion.start()
            stack.callback(motion.stop)
        command = [binary, "measure" if moving else "monitor", str(echo_port), str(port), str(QUADS)]
        status, text, looks = follow(command, feedback)
        if status != 0:
            sys.exit(f"nothing measured: {motion.error or status}")
    return *read(text), list(feedback.activity), looks


def follow(command: list[str], feedback: Feedback) -> tuple[int, str, Looks]:
    """Runs the measuring peer: its exit status, what it has printed, and the looks from its word "ready", with which
    the blocks begin, to its end."""
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    limit = threading.Timer(2 * PATIENCE + 10 * QUADS, run.kill)
    limit.start()
    try:
        assert run.stdout is not None
        text = run.stdout.readline()
        begin = len(feedback.looks)
        text += run.stdout.read()
        return run.wait(), text, feedback.looks[begin:]
    finally:
        limit.cancel()
        end(run)


def read(text: str) -> tuple[Blocks, float, Counts]:
    """What the measuring peer has printed."""
    blocks: Blocks = []
    counts: Counts = {}
    share = 0.0
    for line in text.splitlines():
        kind, *values = line.split()
        if kind == "moving":
            share = float(values[0])
        elif kind == "answers":
            counts[values[0]] = [int(value) for value in values[1:]]
        elif kind in ("echo", "bridge"):
            blocks.append((kind, [float(value) for value in values]))
    return blocks, share, counts


def row(
    figure: str,
    value: float,
    unit: str,
    goal: str = "reported",
    peer: str | None = None,
    peer_value: float | None = None,
    ok: bool = True,
) -> dict[str, object]:
    """A row as `./coglab bench` prints it; one of fewer rounds than asked is a sample."""
    return {
        "bench": "fri",
        "figure": figure,
        "value": round(value, 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": None if peer_value is None else round(peer_value, 4),
        "ok": ok,
        "done": QUADS,
        "asked": ASKED,
    }


def missing_row(where: str, counts: Counts) -> dict[str, object]:
    """Answers that did not come, of all packets that the bridge was sent."""
    sent, missing, late, before = counts["bridge"]
    what = f"answers that did not come within 20 ms {where}, of all {sent} packets to the bridge"
    figure = f"{what} ({before} of them before the blocks; {late} came late)"
    return row(figure, missing, "packets", "0", "bare echo", counts["echo"][1], missing == 0)


def share_row(where: str, share: float) -> dict[str, object]:
    """Whether the motion ran that was to run."""
    figure = f"share of the answers that moved the arm {where}"
    return row(figure, share, "share", f">= {SHARE:g}", ok=share >= SHARE)


def figures(where: str, blocks: Blocks, counts: Counts) -> list[dict[str, object]]:
    """The rows of one way of running."""
    served = [(kind, [v if v >= 0.0 else MISSING for v in values]) for kind, values in blocks]
    medians = [statistics.median(values) for _, values in served]
    p99s = [percentile(values, 0.99) for _, values in served]
    ratios, p99_ratios, echo_p99_ratios = [], [], []
    for first in range(0, len(blocks), 4):  # echo, bridge, bridge, echo
        ratios += [medians[first + 1] / medians[first], medians[first + 2] / medians[first + 3]]
        p99_ratios += [p99s[first + 1] / p99s[first], p99s[first + 2] / p99s[first + 3]]
        echo_p99_ratios.append(p99s[first + 3] / p99s[first])
    ratio, (low, high) = statistics.median(ratios), median_interval(ratios)
    echo_p99 = statistics.median(echo_p99_ratios)
    of = {
        kind: statistics.median(m for (k, _), m in zip(served, medians, strict=True) if k == kind)
        for kind in ("echo", "bridge")
    }
    goal, unit = f"<= {LIMIT:.2f}", "bridge/echo"
    what = f"answer latency {where}"
    return [
        row(f"{what}, median of {len(ratios)} block ratios", ratio, unit, goal, "bare echo", 1.0, ratio <= LIMIT),
        row(f"{what}, upper end of the median's 95 % interval", high, unit, goal, "bare echo", 1.0, high <= LIMIT),
        row(f"{what}, lower end of the median's 95 % interval", low, unit),
        row(f"{what}, median", of["bridge"], "us", "reported", "bare echo", of["echo"]),
        row(f"{what}, ratio of p99", statistics.median(p99_ratios), unit, peer="echo/echo", peer_value=echo_p99),
        missing_row(where, counts),
    ]


def feedback_row(where: str, loaded: list[str], looks: Looks) -> dict[str, object]:
    """How many of the feedback controllers of the shipped list ran."""
    names = ", ".join(loaded) or "none"
    figure = f"feedback controllers that ran at each of {len(looks)} looks, of {len(loaded)} loaded ({names}), {where}"
    count = len(active(looks))
    return row(figure, count, "1", f">= {max(1, len(loaded))}", ok=0 < count >= len(loaded))


def moving_rows(
    beside: str, blocks: Blocks, share: float, counts: Counts, loaded: list[str], looks: Looks
) -> list[dict[str, object]]:
    """The rows of a way in which a motion runs. Without any feedback controller that runs, all of them are missed:
    they would be figures of something else than their names say."""
    count = len(active(looks))
    where = f"while a motion runs, with {count} feedback controller{'' if count == 1 else 's'}{beside}"
    rows = [*figures(where, blocks, counts), share_row(where, share), feedback_row(where, loaded, looks)]
    return [{**each, "ok": bool(each["ok"]) and (count > 0 or each["goal"] == "reported")} for each in rows]


def measured(way: str) -> tuple[Blocks, float, Counts, list[str], Looks]:
    """measure() in a process of its own: a process can be a node of one master alone."""
    run = subprocess.run([sys.executable, __file__, way], stdout=subprocess.PIPE, text=True, check=False, timeout=600)
    if run.returncode != 0:
        sys.exit(f"{way}: nothing measured")
    return json.loads(run.stdout)


def main() -> None:
    """Prints the rows of every way; with the name of one what measure() gives for it."""
    if sys.argv[1:]:
        print(json.dumps(measure(sys.argv[1])))
        return
    blocks, _, counts, *_ = measured("monitor")
    rows = figures("in monitor mode", blocks, counts)
    for way, beside in (("moving", ""), ("console", ", the console and one browser")):
        rows += moving_rows(beside, *measured(way))
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
