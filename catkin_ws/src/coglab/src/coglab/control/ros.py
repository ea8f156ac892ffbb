"""The services of the controller manager that `./coglab controller run` uses."""

from __future__ import annotations

from typing import Any
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
from coglab_msgs.srv import FeedbackSelect, LoadController, StartMotion, SwitchController
from coglab_py.steady import wait_for_service

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
        """Returns the process number of the controller manager; 0 if the ROS master has none, or no master answers.
        Raises SlotError if the manager does not answer."""
        try:
            master = rosgraph.Master("/coglab_control")
            services = dict(master.getSystemState()[2])
            nodes = services.get(f"{MANAGER}/load_controller")
            uri = master.lookupNode(nodes[0]) if nodes else ""
        except (OSError, rosgraph.MasterException):
            return 0
        if not uri:
            return 0
        try:
            proxy: Any = ServerProxy(uri)
            return int(proxy.getPid("/coglab_control")[2])
        except OSError as error:
            why = f"the controller manager at {uri} does not answer ({error})"
            raise SlotError(f"{why}; start the system again, or name another robot by --robot") from error

    @staticmethod
    def _call(name: str, kind: Any, *words: object) -> Any:
        if not rosgraph.is_master_online():
            raise SlotError("no ROS master answers; start the system first: ./coglab launch")
        try:
            wait_for_service(name, WAIT)
            answer = rospy.ServiceProxy(name, kind)(*words)
        except (rospy.ROSException, rospy.ServiceException, OSError) as error:
            raise SlotError(f"{name} does not answer: {error}") from error
        if not answer.success:
            raise SlotError(f"the robot refuses: {answer.message}")
        return answer
