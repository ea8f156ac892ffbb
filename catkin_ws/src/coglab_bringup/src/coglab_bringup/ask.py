"""./coglab start, status, hold and stop: commands to a running system, on any ROS master of this computer.

hold and stop must be quick on a busy computer. So this file needs no ROS, no site-packages and no build.
"""

from __future__ import annotations

import argparse
import os
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

if not __package__:  # ./coglab runs it as a file, in isolated mode
    SOURCES = Path(__file__).resolve().parents[3]
    sys.path[:0] = [str(SOURCES / package / "src") for package in ("coglab_bringup", "coglab_py")]

from coglab_py.actions import SHORT_NAMES, WAYS_OUT
from coglab_py.running_systems import NoSystem, brain_of, find_master, running_systems

from coglab_bringup.ros_wire import Connection, NoAnswer, Reader, call, master_call, subscribe, text
from coglab_bringup.usage import Parser, Refused, master_port

ANSWER_LIMIT = 5.0  # s, longest wait for a service that exists
STATE_LIMIT = 3.0  # s, longest wait for the latched state
LONGEST_START = 600.0  # s, longest wait for the hub while nodes still start
CHANGE_LIMIT = 5.0  # s before an action is refused that the hub does not list: after a hold the list needs a moment
DEFAULT_ACTIONS = ("exchange_human_to_robot", "exchange_robot_to_human")  # the first one that the hub accepts
FACTOR_TOPIC = "/coglab_sim/real_time_factor"
OBJECT_PARAMETER = "/coglab_sim/cell/object/id"  # object that the simulated person offers


def delivery_name(word: str) -> str:
    """The name in `delivery:=NAME`."""
    name = word.removeprefix("delivery:=")
    if name == word or not name:
        raise argparse.ArgumentTypeError(f"delivery:=NAME is expected behind the object, got '{word}'")
    return str(name)


def ask_parser(command: str) -> Parser:
    """./coglab start, status, hold, stop"""
    about = {
        "start": "Waits until the robot is ready, then starts an action; by default it takes, or gives back.",
        "status": "Shows the robot's state, the object in its hand, and why it stands still.",
        "hold": "Brakes the arm and blocks its motion until ./coglab start reset.",
        "stop": "Brakes the arm, blocks its motion until ./coglab start reset, and ends the running action.",
    }[command]
    parser = Parser(prog=f"coglab {command}", description=about)
    if command == "start":
        parser.add_argument(
            "action",
            nargs="?",
            default="",
            metavar="ACTION",
            help="receive, give, take, put, initialise, reset, or an action of your own",
        )
        parser.add_argument(
            "object_id",
            nargs="?",
            default="",
            type=lambda word: word if not word.startswith("delivery:=") else f"/{delivery_name(word)}",
            metavar="OBJECT",
            help="object of the database",
        )
        parser.add_argument(
            "delivery",
            nargs="?",
            type=delivery_name,
            metavar="delivery:=NAME",
            help="how the object is given: a delivery of its file",
        )
        parser.add_argument(
            "--wait", type=float, default=90.0, metavar="S", help="longest wait while no node starts, s (default 90)"
        )
    parser.add_argument(
        "-p", type=master_port, default=0, dest="port", metavar="PORT", help="port of the ROS master, if not clear"
    )
    return parser


@dataclass
class State:
    """Fields of coglab_msgs/MasterState that are used here. `state` is empty until a message arrives."""

    state: str = ""
    in_hub: bool = False
    actions: list[str] = field(default_factory=list)
    object_id: str = ""
    why: str = ""

    @classmethod
    def of(cls, data: bytes) -> State:
        """State from the bytes of a message."""
        reader = Reader(data)
        reader.header()
        return cls(reader.string(), reader.take("?"), reader.strings(), reader.string(), reader.string())


class Brain:
    """Client of the brain of a running system: its latched state and its services."""

    def __init__(self, master: str) -> None:
        self.master = master
        self.state = State()
        self._topic: Connection | None = None

    def _look(self, limit: float) -> None:
        """Receive the states that have arrived. Wait up to `limit` s for one."""
        try:
            self._topic = self._topic or subscribe(self.master, "/coglab/state", ANSWER_LIMIT)
            while (data := self._topic.message(limit)) is not None:
                self.state, limit = State.of(data), 0.0
        except NoAnswer:  # the brain has not started yet, or has ended: look for a new one
            self._topic = None
            time.sleep(min(limit, 0.1))

    def wait_for_state(self, condition: Callable[[State], bool], limit: float) -> bool:
        """Wait until a state meets the condition, up to `limit` s. True if one did."""
        end = time.monotonic() + limit
        self._look(0.0)
        while not (self.state.state and condition(self.state)):
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            self._look(left)
        return True

    def call(self, name: str, request: bytes = b"") -> Reader:
        """Response of a service. Refused if it does not exist or does not answer."""
        try:
            return call(self.master, name, request, ANSWER_LIMIT)
        except NoAnswer as error:
            raise Refused(f"{name} does not answer ({error}); list the nodes: ./coglab shell rosnode list") from error

    def command(self, name: str, *words: str) -> tuple[bool, str]:
        """Success and message of a service whose response has the fields success, reason_code and message."""
        reader = self.call(name, b"".join(text(word) for word in words))
        success, _ = reader.take("?"), reader.take("H")
        return success, reader.string()

    def factor(self) -> float:
        """Simulated time over real time; 1 if nothing is simulated."""
        try:
            topic = subscribe(self.master, FACTOR_TOPIC, 1.0)
            data = topic.message(1.0)
        except NoAnswer:
            return 1.0
        return float(Reader(data).take("d")) if data else 1.0


class Patience:
    """Time that is left for the system to start: `limit` s since the last node came, because nodes start slowly on a
    busy computer. Never longer than LONGEST_START, or `limit` if that is longer."""

    def __init__(self, master: str, limit: float):
        self._master, self._limit = master, limit
        self._begun = self._moved = time.monotonic()
        self._most = 0  # services that were registered at the same time

    def left(self) -> float:
        """Time (s) that is left."""
        now = time.monotonic()
        try:
            services = len(master_call(self._master, "getSystemState")[2])
        except NoAnswer:
            services = 0
        if services > self._most:  # a node that ends and comes again is no progress
            self._most, self._moved = services, now
        return min(self._moved + self._limit, self._begun + max(self._limit, LONGEST_START)) - now


def sentence_of(state: State) -> str:
    """State, object and reason, one per line."""
    name = state.state.rpartition("/")[2]
    takes = f"takes {', '.join(state.actions)}" if state.in_hub else "an action runs"
    held = state.object_id or "none"
    return f"state:  {name} ({takes})\nobject: {held}\nwhy:    {state.why or 'nothing failed'}"


def status(brain: Brain, _options: argparse.Namespace) -> int:
    """Print the latched state."""
    if not brain.wait_for_state(lambda state: True, STATE_LIMIT):
        raise Refused(
            "/coglab/state is not published: the brain is starting, or has ended; see its messages in the terminal "
            "of ./coglab launch"
        )
    print(sentence_of(brain.state))
    factor = brain.factor()
    if factor != 1.0:
        print(f"pace:   the simulated cell runs at {factor:g} of real time: this computer is too busy, or too slow")
    way_out = next((name for name in WAYS_OUT if brain.state.in_hub and name in brain.state.actions), "")
    if way_out:
        print(f"next:   when it is safe: ./coglab start {way_out}")
    return 0


def choose(master: str, options: argparse.Namespace, state: State) -> tuple[str, str]:
    """Action and object to request: those given, otherwise the defaults of this hub. Refused if there is no default."""
    action = options.action or next((name for name in DEFAULT_ACTIONS if name in state.actions), "")
    if not action:
        raise Refused(
            f"{state.state.rpartition('/')[2]} takes {', '.join(state.actions)}; name one: ./coglab start ACTION"
            + (f" ({state.why})" if state.why else "")
        )
    object_id = options.object_id
    if not object_id and action == DEFAULT_ACTIONS[0]:
        try:
            object_id = str(master_call(master, "getParam", OBJECT_PARAMETER))
        except NoAnswer:
            object_id = ""
        if not object_id:
            raise Refused(
                f"{action} needs an object: ./coglab start {action} OBJECT; which there are: ./coglab object list"
            )
    return action, object_id


def start(brain: Brain, options: argparse.Namespace) -> int:
    """Wait for the hub, then request the action. A refusal that may be temporary is retried until the time limit."""
    options.action = SHORT_NAMES.get(options.action, options.action)
    begun, patience, wanted = time.monotonic(), Patience(brain.master, options.wait), options.action
    if not brain.wait_for_state(lambda state: state.in_hub, min(1.0, options.wait)):
        now = brain.state.state.rpartition("/")[2] if brain.state.state else "the brain is starting"
        print(
            f"[coglab] waiting for the hub; gives up {options.wait:.0f} s after the last node has come; now: {now}",
            file=sys.stderr,
            flush=True,
        )
    while (left := patience.left()) > 0:
        if not brain.wait_for_state(lambda state: state.in_hub, min(left, 1.0)):
            continue
        if wanted and wanted not in brain.state.actions:
            brain.wait_for_state(lambda state: wanted in state.actions or not state.in_hub, min(CHANGE_LIMIT, left))
            if brain.state.in_hub and wanted not in brain.state.actions:
                there = " or ".join(f"./coglab start {action}" for action in brain.state.actions)
                raise Refused(f"{brain.state.state.rpartition('/')[2]} does not take '{wanted}'; type: {there}")
            continue
        action, object_id = choose(brain.master, options, brain.state)
        named = f"{object_id}/{options.delivery}" if options.delivery else object_id
        success, message = brain.command("/coglab/start", action, named)
        if success:
            print(f"{f'{action} {object_id}'.strip()}: {message}; watch: ./coglab status")
            return 0
        if brain.wait_for_state(lambda state: not state.in_hub, 0.5):
            continue  # the hub was left at this moment
        raise Refused(f"{message}; more: ./coglab status")
    state = brain.state.state or "/coglab/state never came"
    raise Refused(f"no hub within {time.monotonic() - begun:.0f} s; the machine is in {state}; more: ./coglab status")


def hold(brain: Brain, _options: argparse.Namespace) -> int:
    """Brake the arm and latch the hold."""
    success, message = brain.command("/lwr/command", "hold")
    print(f"{message or 'held'}; on again: ./coglab start reset")
    return 0 if success else 1


def stop(brain: Brain, _options: argparse.Namespace) -> int:
    """STOP of the brain."""
    reader = brain.call("/coglab/stop")
    success, message = reader.take("?"), reader.string()
    print(f"{message}; on again: ./coglab start reset")
    return 0 if success else 1


COMMANDS = {"start": start, "status": status, "hold": hold, "stop": stop}


def main(arguments: list[str]) -> int:
    """Exit status 0: done; 1: refused, with the reason; 2: invalid argument."""
    command, words = arguments[0], arguments[1:]
    top = Path(os.environ["COGLAB_TOP"])
    socket.setdefaulttimeout(ANSWER_LIMIT)  # for answers of the master
    try:
        options = ask_parser(command).parse_args(words)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    try:
        master = find_master(top, options.port, os.environ.get("COGLAB_USER_MASTER", ""))
        if options.port and not brain_of(master) and command != "start":
            raise Refused(f"no system answers on port {options.port}; there are: {running_systems(top) or 'none'}")
        return COMMANDS[command](Brain(master), options)
    except (NoSystem, Refused) as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    try:
        code = main(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # the reader closed the pipe
        code = 0
    sys.exit(code)
