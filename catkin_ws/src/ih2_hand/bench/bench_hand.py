#!/usr/bin/python3
"""Figures of the hand: golden bytes, time per request beside a bare loop, latency, CPU share.

Times are medians over 401 blocks that alternate between driver and bare loops; a block in which the line had to be
resynchronised is left out, and the bench fails where that is more than a tenth. Latency: 25 moves.

Prints one JSON list of rows. Needs a sourced workspace; starts its own ROS master on a free port.
"""

from __future__ import annotations

import json
import os
import random
import select
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import xml.etree.ElementTree as ElementTree
from contextlib import ExitStack
from pathlib import Path

import serial
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.motor import FULL_SCALE
from ih2_hand.emulator.pty_server import PtyServer
from ih2_hand.wire_choices import WIRE

PACKAGE = Path(__file__).resolve().parents[1]
RATE_HZ = 30.0
BLOCKS = 401
SWEEPS = 4
MOVES = 25
CPU_WINDOW_S = 12.0
SLOW = 30
"""Speed at which a full stroke takes longer than CPU_WINDOW_S."""

Row = dict[str, object]


def row(
    figure: str,
    value: float,
    unit: str,
    goal: str | None,
    ok: bool,
    peer: str | None = None,
    peer_value: float | None = None,
) -> Row:
    return {
        "bench": "hand",
        "figure": figure,
        "value": round(value, 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": None if peer_value is None else round(peer_value, 4),
        "ok": bool(ok),
    }


# -- bytes -----------------------------------------------------------------------------------------


def golden_vectors() -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "golden.xml"
        subprocess.run(
            [
                sys.executable,
                "-m",
                "pytest",
                "-q",
                "-p",
                "no:cacheprovider",
                f"--junit-xml={report}",
                str(PACKAGE / "test" / "test_golden_bytes.py"),
            ],
            stdout=subprocess.DEVNULL,
            timeout=120,
            check=False,
        )
        suite = ElementTree.parse(report).getroot().find("testsuite")
    total = int(suite.get("tests"))
    wrong = int(suite.get("failures")) + int(suite.get("errors")) + int(suite.get("skipped"))
    return [row("golden vectors that differ, both dialects", wrong, f"of {total}", "<= 0", wrong == 0 and total > 0)]


# -- time per request ------------------------------------------------------------------------------


def driver_sweep(driver: HandSerialDriver) -> None:
    for motor in range(WIRE.motors):
        driver.get_finger_position(motor)
        driver.get_finger_status(motor)
        driver.get_motor_current(motor)


def bare_sweep(descriptor: int, poll: select.poll) -> None:
    """The same requests by write, wait with a time limit, read: no check, no meaning."""
    for motor in range(WIRE.motors):
        for code, count in ((0x45, 1), (0x4B, 1), (0x49, 2)):
            os.write(descriptor, bytes((code, motor)))
            while count > 0:
                poll.poll(500)
                count -= len(os.read(descriptor, count))


def blocking_sweep(descriptor: int) -> None:
    """The same requests by write and blocking read: no time limit either, so it can hang."""
    for motor in range(WIRE.motors):
        for code, count in ((0x45, 1), (0x4B, 1), (0x49, 2)):
            os.write(descriptor, bytes((code, motor)))
            while count > 0:
                count -= len(os.read(descriptor, count))


def pyserial_sweep(port: serial.Serial) -> None:
    """The same requests by pyserial's write and read."""
    for motor in range(WIRE.motors):
        for code, count in ((0x45, 1), (0x4B, 1), (0x49, 2)):
            port.write(bytes((code, motor)))
            port.read(count)


def time_of(sweep, *arguments) -> float:
    """Microseconds per request."""
    started = time.perf_counter()
    for _ in range(SWEEPS):
        sweep(*arguments)
    return (time.perf_counter() - started) / (SWEEPS * 15) * 1e6


def block_times(port: str) -> list[list[float]]:
    """Microseconds per request of each contestant, block by block, without blocks in which the line was disturbed."""
    # A busy machine may hold the emulator back for longer than a hand ever takes.
    with HandSerialDriver(port, read_timeout=0.5) as driver:
        bare = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        poll = select.poll()
        poll.register(bare, select.POLLIN)
        plain = serial.Serial(port, timeout=0.5)
        blocking = os.open(port, os.O_RDWR | os.O_NOCTTY)
        contestants = (
            (driver_sweep, driver),
            (bare_sweep, bare, poll),
            (blocking_sweep, blocking),
            (pyserial_sweep, plain),
        )
        for contestant in contestants * 3:
            time_of(*contestant)
        times = []
        for _ in range(BLOCKS):
            disturbed = driver.counters.resynchronisations
            block = [time_of(*contestant) for contestant in contestants]
            if driver.counters.resynchronisations == disturbed:
                times.append(block)
        plain.close()
        os.close(bare)
        os.close(blocking)
        if len(times) < 0.9 * BLOCKS:
            raise RuntimeError(
                f"the line was disturbed in {BLOCKS - len(times)} of {BLOCKS} blocks: {driver.counters.reasons}"
            )
    return times


def request_time() -> list[Row]:
    emulator = subprocess.Popen(
        [sys.executable, str(PACKAGE / "scripts" / "hand_emulator.py"), "--greeting"], stdout=subprocess.PIPE, text=True
    )
    try:
        times = block_times(emulator.stdout.readline().split()[1])
    finally:
        emulator.terminate()
        emulator.wait(10)
    ours, *peers = (statistics.median(column) for column in zip(*times, strict=True))
    wire_us = (3 + 3 + 4) / 3 * 10 / WIRE.baud * 1e6
    wire = "the wire's own time per request at 115200 baud, hand's delay not counted (us)"
    rows = []
    for i, (whose, loop) in enumerate(
        (
            ("bare write and read on the same pty", "bare write/poll/read loop (us)"),
            ("write and blocking read, which has no time limit", "write/blocking read loop (us)"),
            ("pyserial write and read", "pyserial write/read loop (us)"),
        )
    ):
        ratio = statistics.median(block[0] / block[1 + i] for block in times)
        rows.append(row(f"driver time per request / {whose}", ratio, "ratio", "<= 1.25", ratio <= 1.25, loop, peers[i]))
    left_out = row(f"blocks left out of {BLOCKS}, the line was disturbed", BLOCKS - len(times), "blocks", None, True)
    return [*rows, left_out, row("driver time per request on the pty", ours, "us", None, True, wire, wire_us)]


# -- node ------------------------------------------------------------------------------------------


class TimedHand(EmulatedHand):
    """Notes when the fingers will have reached their open ends."""

    end = 0.0

    def _move_motor(self, frame: bytes) -> None:
        super()._move_motor(frame)
        rate = FULL_SCALE / WIRE.full_stroke_s / WIRE.speed_max
        self.end = max(
            time.monotonic() + motor.position / (rate * motor.speed) for motor in self.motors if motor.mode == "speed"
        )


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def start(stack: ExitStack, command: list[str]) -> subprocess.Popen:
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def stop() -> None:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(10)

    stack.callback(stop)
    return process


def wait_for(what, seconds: float, text: str) -> None:
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            raise RuntimeError(f"{text} did not come within {seconds:.0f} s")
        time.sleep(0.05)


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def cpu_share(pid: int) -> float:
    """Processor time of a process over CPU_WINDOW_S, as a share of one core."""
    before, begun = cpu_seconds(pid), time.monotonic()
    time.sleep(CPU_WINDOW_S)
    return (cpu_seconds(pid) - before) / (time.monotonic() - begun)


def share_while_closing(pid: int) -> float:
    """The node's processor time while hand_close moves the fingers slowly."""
    import actionlib
    import rospy
    from coglab_msgs.msg import HandCloseAction, HandCloseGoal

    closing = actionlib.SimpleActionClient("/ih2_hand/hand_close", HandCloseAction)
    if not closing.wait_for_server(rospy.Duration(10.0)):
        raise RuntimeError("no hand_close action")
    closing.send_goal(HandCloseGoal(speed=SLOW))
    time.sleep(1.0)
    share = cpu_share(pid)
    if closing.get_state() != actionlib.GoalStatus.ACTIVE:
        raise RuntimeError("hand_close ended during the measurement")
    return share


def node_figures() -> list[Row]:
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{free_port()}"
    os.environ.setdefault("ROS_IP", "127.0.0.1")
    with ExitStack() as stack, tempfile.TemporaryDirectory() as home:
        os.environ["ROS_HOME"] = os.environ["ROS_LOG_DIR"] = home
        start(stack, ["rosmaster", "--core", "-p", os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]])
        import actionlib
        import rosgraph
        import rospy
        from coglab_msgs.msg import HandOpenAction, HandOpenGoal, HandStatus

        wait_for(rosgraph.is_master_online, 20.0, "the ROS master")
        hand = TimedHand(greeting=True)
        server = PtyServer(hand)
        threading.Thread(target=server.serve, daemon=True).start()
        stack.callback(server.shutdown)
        rospy.init_node("bench_hand", disable_signals=True)
        stack.callback(rospy.signal_shutdown, "done")
        rospy.set_param("/ih2_hand/serial_port", server.path)
        rospy.set_param("/ih2_hand/rate", RATE_HZ)
        node = start(stack, [sys.executable, str(PACKAGE / "scripts" / "hand_node.py"), "__name:=ih2_hand"])
        latest: list[HandStatus] = []
        rospy.Subscriber("/ih2_hand/hand_status", HandStatus, lambda status: latest.__setitem__(slice(0, 1), [status]))
        wait_for(lambda: latest and latest[0].connected, 20.0, "the hand node")
        client = actionlib.SimpleActionClient("/ih2_hand/hand_open", HandOpenAction)
        if not client.wait_for_server(rospy.Duration(10.0)):
            raise RuntimeError("no hand_open action")
        delays = [one_move(server, hand, client, HandOpenGoal, number) for number in range(MOVES)]
        time.sleep(1.0)
        share = cpu_share(node.pid)
        moving_share = share_while_closing(node.pid)
    median_ms, limit_ms = statistics.median(delays) * 1e3, 1e3 / RATE_HZ + 20.0
    return [
        row(
            "finger stop to action result, median",
            median_ms,
            "ms",
            f"<= {limit_ms:.1f}",
            median_ms <= limit_ms,
            "one poll period (ms)",
            1e3 / RATE_HZ,
        ),
        row("hand node at 30 Hz hand_status", share * 100.0, "% of one core", "<= 5", share <= 0.05),
        row(
            "hand node at 30 Hz hand_status while a goal moves the fingers",
            moving_share * 100.0,
            "% of one core",
            "reported",
            True,
        ),
    ]


def one_move(server: PtyServer, hand: TimedHand, client, goal_type, number: int) -> float:
    """Seconds from the last finger's stop to the action's result."""
    with server.lock:
        hand.advance()
        for motor in hand.motors:
            motor.stop()
            motor.position = 80.0 + 3.0 * motor.number
    time.sleep(0.1 + random.Random(number).random() / RATE_HZ)
    arrived: list[float] = []
    client.send_goal(goal_type(speed=511), done_cb=lambda *_: arrived.append(time.monotonic()))
    wait_for(lambda: arrived, 20.0, "the result of hand_open")
    result = client.get_result()
    if not result.isOk:
        raise RuntimeError(f"hand_open failed: {result.message}")
    return arrived[0] - hand.end


def main() -> int:
    rows = golden_vectors() + request_time() + node_figures()
    print(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
