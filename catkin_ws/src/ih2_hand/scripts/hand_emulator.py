#!/usr/bin/python3
"""Emulated IH2 hand on a pseudo-terminal; a ROS node when roslaunch or rosrun starts it."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
from collections.abc import Callable

from ih2_hand.emulator.faults import HELP, Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.pty_server import PtyServer
from ih2_hand.trace import Tracer


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="Fault commands:\n" + HELP, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--link", help="symlink to keep on the pty's path")
    parser.add_argument("--dialect", choices=("both", "legacy", "v17"), default="both")
    parser.add_argument(
        "--calibration-scale",
        type=float,
        default=1.0,
        help="factor on the calibration times; 0 ends them at once, above 1.2 "
        "the fast one lasts longer than the 2.0 s that published drivers wait",
    )
    parser.add_argument("--greeting", action="store_true", help="start calibrated")
    parser.add_argument("--strict-force", action="store_true", help="leave a force read of motor 0 unanswered")
    parser.add_argument(
        "--positions", type=int, nargs=5, default=[0] * 5, metavar="P", help="positions at power-on, 0..255"
    )
    parser.add_argument(
        "--contact", type=float, nargs=5, metavar="P", help="positions at which the fingers meet an object; 255: free"
    )
    parser.add_argument(
        "--stiffness", type=float, default=25.0, help="counts of current for each count pressed into the object"
    )
    parser.add_argument(
        "--physical",
        action="store_true",
        help="the motors are turned by the physics of the simulated cell (motor_states, motor_commands)",
    )
    parser.add_argument("--trace", help="file for every frame in hex with its meaning; - is stdout")
    parser.add_argument("--seed", type=int, default=1, help="seed of random garbage")
    parser.add_argument("--fault", action="append", default=[], help="fault command at start")
    parser.add_argument("--commands", action="store_true", help="read fault commands from stdin")
    return parser.parse_args(arguments)


def tracer_to(path: str) -> Callable[[str, bytes, float], None]:
    tracer = Tracer()
    out = sys.stdout if path == "-" else open(path, "a", encoding="utf-8")  # closed at the end of the process

    failed = False

    def write(direction: str, data: bytes, stamp: float) -> None:
        nonlocal failed
        if failed:
            return
        try:
            for line in tracer.feed(direction, data, stamp):
                print(line, file=out, flush=True)
        except OSError as error:  # such as a full disk: the hand goes on
            failed = True
            print(
                f"hand_emulator: the trace ends, {path} cannot be written: {error.strerror}",
                file=sys.stderr,
                flush=True,
            )
            with contextlib.suppress(OSError):
                if out is not sys.stdout:
                    out.close()

    return write


def read_commands(server: PtyServer) -> None:
    for line in sys.stdin:
        if line.strip():
            try:
                print(server.fault(line), flush=True)
            except ValueError as error:
                print(error, flush=True)


def main() -> int:
    as_node = any(argument.startswith("__name:=") for argument in sys.argv)
    arguments, announce, clock = sys.argv[1:], None, None
    if as_node:
        import rospy
        from coglab_py.node_start import init_node
        from coglab_py.pace import Pace
        from coglab_py.steady import end_quietly
        from ih2_hand.ros.emulator_node import CellClock, EmulatorNode

        init_node("hand_emulator", disable_signals=True)
        end_quietly()
        arguments, announce = rospy.myargv(sys.argv)[1:], EmulatorNode.announce
        clock = CellClock(Pace().follow("real_time_factor"))  # of the cell, in the same namespace
    options = parse(arguments)
    try:
        hand = EmulatedHand(
            clock,
            dialect=options.dialect,
            calibration_scale=options.calibration_scale,
            greeting=options.greeting,
            strict_force=options.strict_force,
            positions=options.positions,
            physical=options.physical,
        )
        if options.contact and options.physical:
            raise ValueError("--contact is for a hand without a cell: remove it or --physical")
        if options.contact:
            hand.set_contacts(options.contact, [options.stiffness] * 5)
    except ValueError as error:
        print(f"hand_emulator: {error}", file=sys.stderr)
        return 2

    def show(path: str) -> None:
        print(f"port {path or 'none (unplugged)'}", flush=True)
        if announce:
            announce(path)

    server = PtyServer(
        hand, Faults(hand, seed=options.seed), options.link, show, tracer_to(options.trace) if options.trace else None
    )
    for fault in options.fault:
        try:
            server.fault(fault)
        except ValueError as error:
            print(f"hand_emulator: {error}", file=sys.stderr)
            return 2
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.request_shutdown())
    node = EmulatorNode(server) if as_node else None
    if options.commands:
        threading.Thread(target=read_commands, args=(server,), daemon=True).start()
    server.serve(rospy.is_shutdown if node else lambda: False)
    if node:
        node.stop()
    server.shutdown()
    if node:
        rospy.signal_shutdown("ended")
    return 0


if __name__ == "__main__":
    sys.exit(main())
