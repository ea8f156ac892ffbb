#!/usr/bin/python3
"""The hand: time of a request compared with a bare pyserial loop, delay of a result, slip of a held object.

Request: median ratio of blocks that alternate between driver and loop on the same pseudo-terminal. Blocks with a
disturbed line are left out, at most a tenth. Result: time from the last finger's stop to the action's result, over ROS.
Slip: largest displacement of an object in the palm in 3 s of shaking at 5 m/s^2; five objects, five directions.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import serial
from coglab_bringup.run_directory import free_port, run_environment
from common import SOURCES, Row, end, in_parallel, main, median, shared_module
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.motor import FULL_SCALE
from ih2_hand.emulator.pty_server import PtyServer
from ih2_hand.wire_choices import WIRE

SCRIPTS = SOURCES / "ih2_hand" / "scripts"
RATE = 30.0  # Hz, of the node's polls
REQUESTS = ((0x45, 1), (0x4B, 1), (0x49, 2))  # position, status, current: code and bytes of the answer


# --- requests -------------------------------------------------------------------------------------------------------


def driver_sweep(driver: HandSerialDriver) -> None:
    """Three requests to each motor."""
    for motor in range(WIRE.motors):
        driver.get_finger_position(motor)
        driver.get_finger_status(motor)
        driver.get_motor_current(motor)


def bare_sweep(port: serial.Serial) -> None:
    """The same requests by plain write and read, without checks."""
    for motor in range(WIRE.motors):
        for code, count in REQUESTS:
            port.write(bytes((code, motor)))
            port.read(count)


def microseconds(sweep, port) -> float:
    """Time of a request, us."""
    begin = time.perf_counter()
    for _ in range(4):
        sweep(port)
    return (time.perf_counter() - begin) / (4 * 3 * WIRE.motors) * 1e6


def requests(quick: bool) -> Iterator[Row]:
    """A request to the hand."""
    command = [sys.executable, str(SCRIPTS / "hand_emulator.py"), "--greeting"]
    emulator = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert emulator.stdout is not None
        path = emulator.stdout.readline().split()[1]
        blocks, ratios = 41 if quick else 401, []
        with HandSerialDriver(path, read_timeout=0.5) as driver, serial.Serial(path, timeout=0.5) as bare:
            for _ in range(blocks):
                disturbed = driver.counters.resynchronisations
                ours, theirs = microseconds(driver_sweep, driver), microseconds(bare_sweep, bare)
                if driver.counters.resynchronisations == disturbed:
                    ratios.append(ours / theirs)
    finally:
        end(emulator)
    if len(ratios) < 0.9 * blocks:
        raise RuntimeError(f"the line was disturbed in {blocks - len(ratios)} of {blocks} blocks")
    yield median("a request to the hand over a bare pyserial loop", ratios, "", "<= 1.25")


# --- result ---------------------------------------------------------------------------------------------------------


class TimedHand(EmulatedHand):
    """Computes when the fingers will reach their open ends (`stops`, s, monotonic)."""

    stops = 0.0

    def _move_motor(self, frame: bytes) -> None:
        super()._move_motor(frame)
        rate = FULL_SCALE / WIRE.full_stroke_s / WIRE.speed_max
        moving = [motor.position / (rate * motor.speed) for motor in self.motors if motor.mode == "speed"]
        self.stops = time.monotonic() + max(moving)


def wait_for(ready, seconds: float, what: str) -> None:
    """Waits until ready(). TimeoutError after `seconds`."""
    limit = time.monotonic() + seconds
    while not ready():
        if time.monotonic() > limit:
            raise TimeoutError(f"{what} did not come within {seconds:.0f} s")
        time.sleep(0.05)


def result(quick: bool) -> Iterator[Row]:
    """From the finger's stop to the action's result."""
    with ExitStack() as stack:
        home = Path(stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        port = free_port()
        os.environ.update(run_environment(port, home))
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        stack.callback(end, subprocess.Popen(["rosmaster", "--core", "-p", str(port)], **quiet))
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
        rospy.set_param("/ih2_hand/rate", RATE)
        node = subprocess.Popen([sys.executable, str(SCRIPTS / "hand_node.py"), "__name:=ih2_hand"], **quiet)
        stack.callback(end, node)
        status: list[HandStatus] = []
        rospy.Subscriber("/ih2_hand/hand_status", HandStatus, status.append)
        wait_for(lambda: status and status[-1].connected, 20.0, "the hand node")
        client = actionlib.SimpleActionClient("/ih2_hand/hand_open", HandOpenAction)
        if not client.wait_for_server(rospy.Duration(10.0)):
            raise TimeoutError("no hand_open action within 10 s")
        delays = []
        for number in range(5 if quick else 25):
            with server.lock:
                hand.advance()
                for motor in hand.motors:
                    motor.stop()
                    motor.position = 80.0 + 3.0 * motor.number
            time.sleep(0.1 + random.Random(number).random() / RATE)
            arrived: list[float] = []
            client.send_goal(HandOpenGoal(speed=511), done_cb=lambda *_, to=arrived: to.append(time.monotonic()))
            wait_for(lambda to=arrived: to, 20.0, "the result of hand_open")
            delays.append(1e3 * (arrived[0] - hand.stops))
    yield median("from the finger's stop to the action's result", delays, "ms", f"<= {1e3 / RATE + 20.0:.0f}")


# --- grasp ----------------------------------------------------------------------------------------------------------


def slip_mm(case: tuple[str, str]) -> float:
    """Slip of one object with the palm in one direction; infinite if the object is lost."""
    trials = shared_module("grasp_trial")
    outcome = trials.GraspTrial(trials.objects()[case[0]], case[1]).run()
    return float("inf") if outcome.lost else 1e3 * outcome.slip


def slip(quick: bool) -> Iterator[Row]:
    """Grasps by friction."""
    trials = shared_module("grasp_trial")
    cases = [(name, direction) for name in trials.objects() for direction in trials.DIRECTIONS]
    worst = max(in_parallel(slip_mm, cases[:2] if quick else cases))
    yield Row("slip of a held object under 5 m/s^2, worst", worst, "mm", "<= 3", f"of {len(cases)} grasps")


if __name__ == "__main__":
    main("hand", requests, result, slip)
