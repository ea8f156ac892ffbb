"""Runs a controller of one file on the running robot: `./coglab controller run FILE`."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from pathlib import Path
from types import FrameType

from coglab.control import slot as wire
from coglab.control.host import MotionHost, find_class, load_module, serve
from coglab.control.motion import ControlError
from coglab.control.ros import SlotServices

SLOTS = {wire.MOTION: "python_motion", wire.FEEDBACK: "python_feedback"}
REPORT = 5.0  # s between two lines about latency and misses


def parser() -> argparse.ArgumentParser:
    """Arguments of the command."""
    result = argparse.ArgumentParser(
        prog="./coglab controller run",
        description="Connects a Python motion to the robot that runs. Ctrl-C lets go: the arm brakes.",
    )
    result.add_argument("file", type=Path, help="Python file with one class of a motion (start, reference, done)")
    result.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help="arguments of the motion, e.g. radius=0.1")
    result.add_argument("--class", dest="name", default="", help="which class, if the file has several")
    result.add_argument("--slot", default="", help="id of the controller in the robot (python_motion)")
    result.add_argument("--robot", type=int, default=0, help="number of the robot's process, if several run")
    result.add_argument("--start", action="store_true", help="activate the controller and start the motion at once")
    return result


def numbers(words: list[str]) -> dict[str, float]:
    """`["radius=0.1"]` as `{"radius": 0.1}`. Raises ControlError."""
    result = {}
    for word in words:
        name, equals, value = word.partition("=")
        try:
            if not equals:
                raise ValueError
            result[name] = float(value)
        except ValueError:
            raise ControlError(f"'{word}': NAME=NUMBER is expected, for example radius=0.1") from None
    return result


def choose(slot: str, robot: int) -> wire.Address | None:
    """The offered slot of that id; None if nobody offers it. Raises SlotError if several robots do."""
    found = [one for one in wire.offered() if one.slot == slot and robot in (0, one.robot)]
    if len(found) > 1:
        pids = ", ".join(str(one.robot) for one in found)
        raise wire.SlotError(f"{len(found)} robots offer the slot '{slot}'; choose one with --robot: {pids}")
    return found[0] if found else None


def run(words: list[str]) -> int:
    """Run the command. Return its exit status."""
    options = parser().parse_args(words)
    ended = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        ended.set()

    try:
        controller, kind = find_class(load_module(options.file), options.name)
        if kind == wire.FEEDBACK:
            raise ControlError(
                f"{controller.__name__} is a feedback controller; this command runs motions only. Load the class in "
                "coglab.World"
            )
        host = MotionHost(controller(), numbers(options.arguments))
        slot = options.slot or SLOTS[kind]
        services = SlotServices()
        address = choose(slot, options.robot)
        if address is None:
            services.load(slot)
            address = choose(slot, services.robot())
        if address is None:
            raise wire.SlotError(f"the robot loaded '{slot}', but it runs on another computer; run this one there")
        with wire.Slot(address, kind) as connection:
            signal.signal(signal.SIGINT, end)
            signal.signal(signal.SIGTERM, end)
            print(f"{controller.__name__} holds the slot {slot} of the robot (process {address.robot}); Ctrl-C lets go")
            if options.start:
                starter = threading.Thread(target=_start, args=(services, slot, ended), daemon=True)
                starter.start()
            else:
                print(f"start it: rosservice call /controller_manager/{slot}/start_motion '{{}}'", flush=True)
            serve(connection, host, ends=ended.is_set, period=REPORT, tell=_tell)
    except (ControlError, wire.SlotError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print("let go")
    return 0


def _start(services: SlotServices, slot: str, ended: threading.Event) -> None:
    try:
        services.start(slot)
    except wire.SlotError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        ended.set()


def _tell(text: str) -> None:
    print(time.strftime("%H:%M:%S"), text, flush=True)


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
