"""./coglab start, status, hold and stop: what is said to a system that runs, wherever its ROS master listens.

hold and stop have to be quick beside whatever else runs: this file needs no ROS, no site-packages and no build.
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
from urllib.parse import urlparse

if not __package__:  # run as a file, isolated: ./coglab does
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from coglab_bringup.ros_wire import Connection, NoAnswer, Reader, call, master_call, subscribe, text
from coglab_bringup.run_directory import running_systems
from coglab_bringup.usage import Parser, Refused, master_port

DEFAULT_MASTER = "http://127.0.0.1:11311"  # of a plain roslaunch
ANSWER_LIMIT = 5.0  # s for a service that exists
STATE_LIMIT = 3.0  # s for the latched state
CHANGE_LIMIT = 5.0  # s in a hub that does not take the action until it is refused: a hold takes a moment to show
DEFAULT_ACTIONS = ("exchange_human_to_robot", "exchange_robot_to_human")  # whichever the hub takes
FACTOR_TOPIC = "/coglab_sim/real_time_factor"
OBJECT_PARAMETER = "/coglab_sim/cell/object/id"  # what the simulated person holds out


def ask_parser(command: str) -> Parser:
    """./coglab start, status, hold, stop"""
    about = {
        "start": "Waits for the hub, then starts an action; by default takes from the person, or gives back.",
        "status": "State, object and why, of the system that runs.",
        "hold": "Brakes and latches; ./coglab start reset goes on.",
        "stop": "STOP: brakes, latches and ends the action; ./coglab start reset goes on.",
    }[command]
    parser = Parser(prog=f"coglab {command}", description=about)
    if command == "start":
        parser.add_argument(
            "action",
            nargs="?",
            default="",
            metavar="ACTION",
            help="exchange_human_to_robot, exchange_robot_to_human, take, put, initialise, reset",
        )
        parser.add_argument("object_id", nargs="?", default="", metavar="OBJECT", help="of the object database")
        parser.add_argument("--wait", type=float, default=90.0, metavar="S", help="for the hub, at most (default 90)")
    parser.add_argument(
        "-p", type=master_port, default=0, dest="port", metavar="PORT", help="of the ROS master, if several systems run"
    )
    return parser


def brain_of(master: str) -> bool:
    """Whether a ROS master answers there and knows the brain."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(1.0)
    try:
        return bool(master_call(master, "lookupService", "/coglab/start"))
    except NoAnswer:
        return False
    finally:
        socket.setdefaulttimeout(before)


def find_master(top: Path, port: int, users_own: str) -> str:
    """The master to speak to: of the port that was named, of the user's ROS_MASTER_URI if a brain is there, of the only
    system that runs, or of a plain roslaunch. Refused if there is none, or several."""
    systems = running_systems(top)
    if port:
        return f"http://127.0.0.1:{port}"
    if users_own and urlparse(users_own).port not in systems and brain_of(users_own):
        return users_own
    if urlparse(users_own).port in systems:
        return users_own
    if len(systems) > 1:
        there = ", ".join(f"-p {number} ({command})" for number, command in systems.items())
        raise Refused(f"several systems run; say which: {there}")
    if systems:
        return f"http://127.0.0.1:{next(iter(systems))}"
    if brain_of(DEFAULT_MASTER):
        return DEFAULT_MASTER
    raise Refused("no system runs; start one: ./coglab launch")


@dataclass
class State:
    """coglab_msgs/MasterState, as far as it is shown or used here; `state` is empty as long as none has come."""

    state: str = ""
    in_hub: bool = False
    actions: list[str] = field(default_factory=list)
    object_id: str = ""
    why: str = ""

    @classmethod
    def of(cls, data: bytes) -> State:
        """From the bytes of a message."""
        reader = Reader(data)
        reader.header()
        return cls(reader.string(), reader.take("?"), reader.strings(), reader.string(), reader.string())


class Brain:
    """The brain of a running system, by its latched state and its services."""

    def __init__(self, master: str) -> None:
        self.master = master
        self.state = State()
        self._topic: Connection | None = None

    def _look(self, limit: float) -> None:
        """Takes the states that have come; waits `limit` s at most for one."""
        try:
            self._topic = self._topic or subscribe(self.master, "/coglab/state", ANSWER_LIMIT)
            while (data := self._topic.message(limit)) is not None:
                self.state, limit = State.of(data), 0.0
        except NoAnswer:  # the brain is not there yet, or has ended: a new one is looked for
            self._topic = None
            time.sleep(min(limit, 0.1))

    def wait_for_state(self, condition: Callable[[State], bool], limit: float) -> bool:
        """Waits until a state has come for which the condition holds; whether it did within `limit` s."""
        end = time.monotonic() + limit
        self._look(0.0)
        while not (self.state.state and condition(self.state)):
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            self._look(left)
        return True

    def call(self, name: str, request: bytes = b"") -> Reader:
        """The response of a service. Refused if it does not exist or does not answer."""
        try:
            return call(self.master, name, request, ANSWER_LIMIT)
        except NoAnswer as error:
            raise Refused(f"{name} does not answer ({error}); what runs: ./coglab shell rosnode list") from error

    def command(self, name: str, *words: str) -> tuple[bool, str]:
        """Success and message of a service that answers with success, reason_code and message."""
        reader = self.call(name, b"".join(text(word) for word in words))
        success, _ = reader.take("?"), reader.take("H")
        return success, reader.string()

    def factor(self) -> float:
        """Simulated over real time; 1 where nothing is simulated."""
        try:
            topic = subscribe(self.master, FACTOR_TOPIC, 1.0)
            data = topic.message(1.0)
        except NoAnswer:
            return 1.0
        return float(Reader(data).take("d")) if data else 1.0


def sentence_of(state: State) -> str:
    """State, object and why, a line each."""
    name = state.state.rpartition("/")[2]
    takes = f"takes {', '.join(state.actions)}" if state.in_hub else "an action is under way"
    held = state.object_id or "none"
    return f"state:  {name} ({takes})\nobject: {held}\nwhy:    {state.why or 'nothing failed'}"


def status(brain: Brain, _options: argparse.Namespace) -> int:
    """Prints the latched state."""
    if not brain.wait_for_state(lambda state: True, STATE_LIMIT):
        raise Refused(
            "/coglab/state says nothing: the brain is starting, or it has ended; its words are in the terminal "
            "of ./coglab launch"
        )
    print(sentence_of(brain.state))
    factor = brain.factor()
    if factor != 1.0:
        print(f"pace:   the simulated cell runs at {factor:g} of real time: this computer is too busy, or too slow")
    if brain.state.in_hub and "reset" in brain.state.actions:
        print("next:   ./coglab start reset")
    return 0


def choose(master: str, options: argparse.Namespace, state: State) -> tuple[str, str]:
    """Action and object to ask for: what was named, else what this hub is there for. Refused if that cannot be said."""
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
    """Waits for the hub, then asks for the action; a refusal that the next hub may not repeat is waited for."""
    deadline, wanted = time.monotonic() + options.wait, options.action
    if not brain.wait_for_state(lambda state: state.in_hub, min(1.0, options.wait)):
        now = brain.state.state.rpartition("/")[2] if brain.state.state else "the brain is starting"
        print(f"[coglab] waiting for the hub, {options.wait:.0f} s at most; now: {now}", file=sys.stderr, flush=True)
    while (left := deadline - time.monotonic()) > 0:
        if not brain.wait_for_state(lambda state: state.in_hub, left):
            break
        if wanted and wanted not in brain.state.actions:
            brain.wait_for_state(lambda state: wanted in state.actions or not state.in_hub, min(CHANGE_LIMIT, left))
            if brain.state.in_hub and wanted not in brain.state.actions:
                there = " or ".join(f"./coglab start {action}" for action in brain.state.actions)
                raise Refused(f"{brain.state.state.rpartition('/')[2]} does not take '{wanted}'; type: {there}")
            continue
        action, object_id = choose(brain.master, options, brain.state)
        success, message = brain.command("/coglab/start", action, object_id)
        if success:
            print(f"{f'{action} {object_id}'.strip()}: {message}; watch: ./coglab status")
            return 0
        if brain.wait_for_state(lambda state: not state.in_hub, 0.5):
            continue  # the hub was left in that moment
        raise Refused(message)
    state = brain.state.state or "/coglab/state never came"
    raise Refused(f"no hub within {options.wait:.0f} s; the machine is in {state}; more: ./coglab status")


def hold(brain: Brain, _options: argparse.Namespace) -> int:
    """Brakes and latches the arm."""
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
    """Exit status 0: done; 1: refused, with the reason; 2: an argument that there is not."""
    command, words = arguments[0], arguments[1:]
    top = Path(os.environ["COGLAB_TOP"])
    socket.setdefaulttimeout(ANSWER_LIMIT)  # of the master's answers
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
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    try:
        code = main(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads has seen enough
        code = 0
    sys.exit(code)
