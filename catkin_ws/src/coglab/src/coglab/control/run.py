"""Runs a controller of one file on the running robot: `./coglab controller run FILE`."""

from __future__ import annotations

import argparse
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import TypeAlias

from coglab.control import slot as wire
from coglab.control.feedback_host import FeedbackHost
from coglab.control.host import MotionHost, find_class, load_module, serve
from coglab.control.motion import ControlError
from coglab.control.ros import MANAGER, SlotServices

SLOTS = {wire.MOTION: "python_motion", wire.FEEDBACK: "python_feedback"}
TYPES = {wire.MOTION: "coglab/RemoteMotion", wire.FEEDBACK: "RemoteFeedback"}
MOST_SLOTS = 4  # slots for feedback controllers without --slot
REPORT = 5.0  # s between two reports of latency and late answers
APPEARS = 3.0  # s, longest wait for a slot that another process loads
LAST = 1.0  # s from Ctrl-C until the process of a blocked controller is ended

Numbers: TypeAlias = dict[str, float | list[float]]
Host: TypeAlias = MotionHost | FeedbackHost


class Flag:
    """Flag for the end of the command. A signal may set it at any time, even twice: no lock, no new thread."""

    def __init__(self) -> None:
        self._up = False

    def set(self) -> None:
        """End."""
        self._up = True

    def is_set(self) -> bool:
        """Returns True if the command shall end."""
        return self._up


def parser() -> argparse.ArgumentParser:
    """Arguments of the command."""
    result = argparse.ArgumentParser(
        prog="./coglab controller run",
        description="Connects a Python motion or feedback controller to the running robot. Ctrl-C disconnects: the arm "
        "brakes, or the correction fades. In a terminal, NAME=VALUE and Enter changes a gain, or an argument of the "
        "next motion.",
    )
    result.add_argument(
        "file",
        type=Path,
        help="Python file with one class: a motion (start, reference, done) or a ctrl_more.FeedbackController",
    )
    result.add_argument(
        "numbers",
        nargs="*",
        metavar="NAME=VALUE",
        help="arguments of the motion, or gains: radius=0.1, mass=4,4,4",
    )
    result.add_argument("--class", dest="name", default="", help="which class, if the file has several")
    result.add_argument("--config", type=Path, help="gains and settings of a feedback controller, as in a list file")
    result.add_argument(
        "--slot", default="", help="id of the slot in the robot (python_motion; the first free python_feedback)"
    )
    result.add_argument(
        "--robot", type=int, default=0, help="number of the robot's process; default: of the ROS master"
    )
    result.add_argument("--start", action="store_true", help="a motion: activate the slot and start the motion at once")
    result.add_argument(
        "--wait", action="store_true", help="a feedback controller: connect only; it acts when its slot is enabled"
    )
    return result


def numbers(words: list[str]) -> Numbers:
    """`["radius=0.1", "mass=4,4,4"]` as `{"radius": 0.1, "mass": [4.0, 4.0, 4.0]}`. Raises ControlError."""
    result: Numbers = {}
    for word in words:
        name, equals, text = word.partition("=")
        try:
            values = [float(part) for part in text.split(",")]
        except ValueError:
            values = []
        if not equals or not values:
            raise ControlError(f"'{word}': NAME=NUMBER is expected, for example radius=0.1 or mass=4,4,4")
        result[name.strip()] = values[0] if len(values) == 1 else values
    return result


def make_host(options: argparse.Namespace) -> tuple[Host, int]:
    """Returns the host with the controller of the file, and its kind. Raises ControlError."""
    controller, kind = find_class(load_module(options.file), options.name)
    given = numbers(options.numbers)
    try:
        made = controller()
    except Exception as error:
        raise ControlError(f"{controller.__name__}() raised {type(error).__name__}: {error}") from error
    if kind == wire.FEEDBACK:
        return FeedbackHost(made, given, config=options.config), kind
    if options.config:
        raise ControlError("--config is for feedback controllers; give a motion its arguments as NAME=VALUE")
    return MotionHost(made, given), kind


def choose(slot: str, robot: int) -> wire.Address | None:
    """The offered slot of that id; None if nobody offers it. Raises SlotError if several robots do."""
    found = [one for one in wire.offered() if one.slot == slot and robot in (0, one.robot)]
    if len(found) > 1:
        pids = ", ".join(str(one.robot) for one in found)
        raise wire.SlotError(f"{len(found)} robots offer the slot '{slot}'; choose one with --robot: {pids}")
    return found[0] if found else None


def connect(options: argparse.Namespace, kind: int, services: SlotServices) -> wire.Slot:
    """Connect to the slot. Load it into the robot if it is missing. Raises SlotError.

    Without --robot, the robot of the ROS master is taken; without a master, the only robot that offers the slot, such
    as a World. A feedback controller without --slot gets the first slot that no other process holds.
    """
    ids = [options.slot or SLOTS[kind]]
    if kind == wire.FEEDBACK and not options.slot:
        ids += [f"{SLOTS[kind]}_{number}" for number in range(2, MOST_SLOTS + 1)]
    robot = options.robot or services.robot()
    for slot in ids:
        address = choose(slot, robot)
        if address is None:
            try:
                services.load(slot, TYPES[kind])
            except wire.SlotError:
                late = time.monotonic() + APPEARS  # another process may just be loading it
                while choose(slot, robot) is None:
                    if time.monotonic() > late:
                        raise
                    time.sleep(0.05)
            address = choose(slot, robot)
        if address is None:
            raise wire.SlotError(f"the robot loaded '{slot}', but it runs on another computer; run this one there")
        try:
            return wire.Slot(address, kind)
        except wire.SlotTaken:
            if slot == ids[-1]:
                raise
    raise AssertionError("unreachable")


def run(words: list[str]) -> int:
    """Run the command. Return its exit status."""
    options = parser().parse_intermixed_args(words)  # so that options may come before NAME=VALUE
    ended, refused, over = Flag(), Flag(), threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        ended.set()

    threading.Thread(target=_watch, args=(ended, over), daemon=True).start()
    try:
        host, kind = make_host(options)
        services = SlotServices()
        with connect(options, kind, services) as connection:
            signal.signal(signal.SIGINT, end)
            signal.signal(signal.SIGTERM, end)
            address = connection.address
            name = type(host.motion if isinstance(host, MotionHost) else host.controller).__name__
            print(f"{name} holds the slot {address.slot} of the robot (process {address.robot}); Ctrl-C lets go")
            act, how = services.start, f"rosservice call {MANAGER}/{address.slot}/start_motion '{{}}'"
            silent = ""
            if kind == wire.FEEDBACK:
                act, how = services.enable, f"rosservice call {MANAGER}/feedback/enable '{{names: [{address.slot}]}}'"
                silent = (
                    f"the robot sends no question: {address.slot} is disabled, as by a motion whose profile does "
                    f"not name it, or the robot measures nothing. Enable it: {how}"
                )
            if options.start or (kind == wire.FEEDBACK and not options.wait):
                threading.Thread(target=_act, args=(act, address.slot, ended, refused), daemon=True).start()
            else:
                print(f"start it: {how}", flush=True)
            if sys.stdin is not None and sys.stdin.isatty():
                threading.Thread(target=_listen, args=(host, ended), daemon=True).start()
            serve(connection, host, ends=ended.is_set, period=REPORT, report=_report, silent=silent)
    except (ControlError, wire.SlotError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted before the controller was connected", file=sys.stderr)
        return 130
    finally:
        over.set()
    print("let go", flush=True)
    return int(refused.is_set())


def _act(act: Callable[[str], None], slot: str, ended: Flag, refused: Flag) -> None:
    try:
        act(slot)
    except wire.SlotError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        refused.set()
        ended.set()


def _listen(host: Host, ended: Flag) -> None:
    """Take NAME=VALUE from the terminal."""
    while not ended.is_set():
        ready, _, _ = select.select([sys.stdin], [], [], 0.2)
        # The shell would stop a background process that reads.
        if not ready or os.tcgetpgrp(sys.stdin.fileno()) != os.getpgrp():
            time.sleep(0.2)
            continue
        line = sys.stdin.readline()
        if not line:
            return
        try:
            host.set(numbers(line.split()))
            _report(f"set {line.strip()}" if line.strip() else "NAME=VALUE changes a gain or an argument")
        except ControlError as error:
            _report(f"not changed: {error}")


def _watch(ended: Flag, over: threading.Event) -> None:
    """End this process if its controller does not return after Ctrl-C. The robot detects the end."""
    while not ended.is_set():
        if over.wait(0.1):
            return
    if over.wait(LAST):
        return
    print("the controller does not return; this process ends", file=sys.stderr, flush=True)
    os._exit(1)


def _report(text: str) -> None:
    print(time.strftime("%H:%M:%S"), text, flush=True)


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
