"""The services of the controller manager that `./coglab controller run` uses."""

from __future__ import annotations

from typing import Any

import rosgraph
import rospy
from coglab_msgs.srv import FeedbackSelect, LoadController, StartMotion, SwitchController
from coglab_py.node_start import answer
from coglab_py.steady import call_service

from coglab.control.slot import SlotError

MANAGER = "/controller_manager"
WAIT = 10.0  # s, longest wait for a service


class SlotServices:
    """Loads, enables and starts a slot in the running robot."""

    def load(self, slot: str, kind: str) -> None:
        """Load a slot of the type `kind`. Raises SlotError if no robot runs, or with its refusal."""
        self._call(f"{MANAGER}/load_controller", LoadController, slot, kind)

    def enable(self, slot: str) -> None:
        """Enable the slot of a feedback controller. Raises SlotError with the refusal."""
        self._call(f"{MANAGER}/feedback/enable", FeedbackSelect, [slot], "")

    def start(self, slot: str) -> None:
        """Make the slot the active controller and start its motion. Raises SlotError with the refusal."""
        self._call(f"{MANAGER}/switch_controller", SwitchController, slot)
        self._call(f"{MANAGER}/{slot}/start_motion", StartMotion, [], [], False)

    def robot(self) -> int:
        """Returns the process number of the controller manager; 0 if the ROS master has none, or there is no master.
        Raises SlotError if one of them does not answer."""
        master = asked = rosgraph.get_master_uri()
        try:
            state = answer(master, "getSystemState")
            nodes = dict(state[2]).get(f"{MANAGER}/load_controller") if state else None
            uri = answer(master, "lookupNode", nodes[0]) if nodes else None
            if not uri:
                return 0
            asked = uri
            process = answer(uri, "getPid")
        except TimeoutError:
            process = None
        if process is None:
            who = "ROS master" if asked == master else "controller manager"
            raise SlotError(
                f"the {who} at {asked} does not answer; start the system again, or name another robot by --robot"
            )
        return int(process)

    @staticmethod
    def _call(name: str, kind: Any, *words: object) -> Any:
        try:
            online = answer(rosgraph.get_master_uri(), "getPid") is not None
        except TimeoutError:
            online = False
        if not online:
            raise SlotError("no ROS master answers; start the system first: ./coglab launch")
        try:
            response = call_service(name, kind, *words, wait=WAIT)
        except (rospy.ROSException, rospy.ServiceException, OSError) as error:
            raise SlotError(f"{name} does not answer: {error}") from error
        if not response.success:
            raise SlotError(f"the robot refuses: {response.message}")
        return response
