"""./coglab start, status, hold and stop: what is said to a system that runs, wherever its ROS master listens."""

from __future__ import annotations

import argparse
import os
import socket
import sys
import threading
import time
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlparse

from coglab_bringup.arguments import ask_parser
from coglab_bringup.run_directory import running_systems
from coglab_bringup.usage import Refused

DEFAULT_MASTER = "http://127.0.0.1:11311"  # of a plain roslaunch
ANSWER_LIMIT = 5.0  # s for a service that exists
STATE_LIMIT = 3.0  # s for the latched state
CHANGE_LIMIT = 5.0  # s in a hub that does not take the action until it is refused: a hold takes a moment to show
DEFAULT_ACTIONS = ("exchange_human_to_robot", "exchange_robot_to_human")  # whichever the hub takes
OBJECT_PARAMETER = "/coglab_sim/cell/object/id"  # what the simulated person holds out


def brain_of(master: str) -> bool:
    """Whether a ROS master answers there and knows the brain."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(1.0)
    try:
        answer: Any = xmlrpc.client.ServerProxy(master).lookupService("/coglab_ask", "/coglab/start")
        return bool(answer[0] == 1)
    except (OSError, xmlrpc.client.Error):
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


class Brain:
    """The brain of a running system, by its latched state and its services."""

    def __init__(self) -> None:
        import rospy
        from coglab_msgs.msg import MasterState

        self.changed = threading.Condition()
        self.state: Any = None
        rospy.init_node("coglab_ask", anonymous=True, disable_rosout=True, disable_rostime=True, disable_signals=True)
        rospy.Subscriber("/coglab/state", MasterState, self._on_state, queue_size=1)

    def _on_state(self, message: object) -> None:
        with self.changed:
            self.state = message
            self.changed.notify_all()

    def wait_for_state(self, condition: Callable[[Any], bool], limit: float) -> bool:
        """Waits until a state has come for which the condition holds; whether it did within `limit` s."""
        with self.changed:
            return self.changed.wait_for(lambda: self.state is not None and condition(self.state), limit)

    @staticmethod
    def call(name: str, kind: type, *request: object) -> Any:
        """The answer of a service. Refused if it does not exist or does not answer."""
        import rospy

        try:
            rospy.wait_for_service(name, timeout=ANSWER_LIMIT)
            return rospy.ServiceProxy(name, kind)(*request)
        except (rospy.ROSException, rospy.ServiceException) as error:
            raise Refused(f"{name} does not answer ({error}); what runs: ./coglab shell rosnode list") from error


def sentence_of(state: Any) -> str:
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
    if brain.state.in_hub and "reset" in brain.state.actions:
        print("next:   ./coglab start reset")
    return 0


def choose(options: argparse.Namespace, state: Any) -> tuple[str, str]:
    """Action and object to ask for: what was named, else what this hub is there for. Refused if that cannot be said."""
    import rospy

    action = options.action or next((name for name in DEFAULT_ACTIONS if name in state.actions), "")
    if not action:
        raise Refused(
            f"{state.state.rpartition('/')[2]} takes {', '.join(state.actions)}; name one: ./coglab start ACTION"
            + (f" ({state.why})" if state.why else "")
        )
    object_id = options.object_id
    if not object_id and action == DEFAULT_ACTIONS[0]:
        object_id = rospy.get_param(OBJECT_PARAMETER, "")
        if not object_id:
            raise Refused(
                f"{action} needs an object: ./coglab start {action} OBJECT; which there are: ./coglab object list"
            )
    return action, object_id


def start(brain: Brain, options: argparse.Namespace) -> int:
    """Waits for the hub, then asks for the action; a refusal that the next hub may not repeat is waited for."""
    from coglab_msgs.srv import Start

    deadline, wanted = time.monotonic() + options.wait, options.action
    if not brain.wait_for_state(lambda state: state.in_hub, min(1.0, options.wait)):
        now = brain.state.state.rpartition("/")[2] if brain.state else "the brain is starting"
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
        action, object_id = choose(options, brain.state)
        answer = brain.call("/coglab/start", Start, action, object_id)
        if answer.success:
            print(f"{f'{action} {object_id}'.strip()}: {answer.message}; watch: ./coglab status")
            return 0
        if brain.wait_for_state(lambda state: not state.in_hub, 0.5):
            continue  # the hub was left in that moment
        raise Refused(answer.message)
    state = brain.state.state if brain.state else "/coglab/state never came"
    raise Refused(f"no hub within {options.wait:.0f} s; the machine is in {state}; more: ./coglab status")


def hold(brain: Brain, _options: argparse.Namespace) -> int:
    """Brakes and latches the arm."""
    from coglab_msgs.srv import LwrCommand

    answer = brain.call("/lwr/command", LwrCommand, "hold")
    print(f"{answer.message or 'held'}; on again: ./coglab start reset")
    return 0 if answer.success else 1


def stop(brain: Brain, _options: argparse.Namespace) -> int:
    """STOP of the brain."""
    from std_srvs.srv import Trigger

    answer = brain.call("/coglab/stop", Trigger)
    print(f"{answer.message}; on again: ./coglab start reset")
    return 0 if answer.success else 1


COMMANDS = {"start": start, "status": status, "hold": hold, "stop": stop}


def main(arguments: list[str]) -> int:
    """Exit status 0: done; 1: refused, with the reason; 2: an argument that there is not."""
    command, words = arguments[0], arguments[1:]
    top = Path(os.environ["COGLAB_TOP"])
    try:
        options = ask_parser(command).parse_args(words)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    try:
        master = find_master(top, options.port, os.environ.get("COGLAB_USER_MASTER", ""))
        os.environ["ROS_MASTER_URI"] = master
        if options.port and not brain_of(master) and command != "start":
            raise Refused(f"no system answers on port {options.port}; there are: {running_systems(top) or 'none'}")
        return COMMANDS[command](Brain(), options)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    try:
        code = main(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads has seen enough
        code = 0
    sys.stderr.flush()
    os._exit(code)  # at once: rospy's threads would take their time
