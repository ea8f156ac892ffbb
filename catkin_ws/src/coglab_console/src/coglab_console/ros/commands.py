"""Sends STOP and the commands of the page to the robot, by services and topics that every node can use."""

from __future__ import annotations

import asyncio
import hashlib
import json
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import (
    AddPtp,
    ArmContact,
    FeedbackSelect,
    Learn,
    LwrCommand,
    Reload,
    SetExecutionOrder,
    SetSpeedScale,
    Start,
    SwitchController,
)
from coglab_py.steady import call_service, worker
from rospy.core import parse_rosrpc_uri
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ..desk.control_conditions import Standing
from ..desk.desk import DeskReply
from ..desk.words import plain
from .knowledge import lookup
from .view import RosView

LIMIT = 6.0  # s that one command may take
HAND_LIMIT = 3.0  # s that the hand may take to begin or refuse a calibration
MAX_WAITING = 12  # commands whose service has not answered
STOP_ANSWER_LIMIT = 3.0  # s until a missing answer to STOP is reported
MAX_WAITING_STOPS = 8  # threads whose service has not answered a STOP
HOME_CONTROLLER = "ptp"
NOTES, NEXT_OBJECT = "coglab/note", "coglab/next_object"
HIDDEN = ("robot_description", "roslaunch", "rosdistro", "run_id")
MAX_PARAMETERS = 2000


class RosBackend:
    """The Backend of the desk."""

    def __init__(self, view: RosView, stop: Callable[[str], None], real: bool) -> None:
        self.real = real
        self._view, self._stop = view, stop
        self._calibration = rospy.Publisher("ih2_hand/hand_calibration", String, queue_size=2)
        self._waiting = threading.Semaphore(MAX_WAITING)
        self._marks: queue.SimpleQueue[dict[str, str]] = queue.SimpleQueue()
        threading.Thread(target=self._write_marks, name="trial_names", daemon=True).start()
        self._publishers = {
            "note": rospy.Publisher(NOTES, String, queue_size=20),
            "select_object": rospy.Publisher(NEXT_OBJECT, String, queue_size=5, latch=True),
        }

    def listen(self, received: Callable[[str, str, str], None]) -> None:
        """Calls `received(name, text, who)` for messages of other nodes on the topics of notes and next objects."""

        def heard(message: String, name: str) -> None:
            who = message._connection_header.get("callerid", "somebody")
            if who != rospy.get_name():
                received(name, message.data, who)

        for name, topic in (("note", NOTES), ("select_object", NEXT_OBJECT)):
            rospy.Subscriber(topic, String, heard, name, queue_size=20)

    def publish(self, name: str, text: str) -> None:
        """See Backend."""
        self._publishers[name].publish(String(text))

    def mark(self, names: dict[str, str]) -> None:
        """See Backend."""
        self._marks.put(names)

    def _write_marks(self) -> None:
        """Writes the names to the master in its own thread, so that the desk does not wait for the master."""
        while not rospy.is_shutdown():
            names = self._marks.get()
            try:
                rospy.set_param("coglab/trial", names)
            except Exception as error:  # of the master
                rospy.logwarn("recordings will not have the names of this trial: %s", error)

    def standing(self) -> Standing:
        """See Backend."""
        return self._view.standing()

    def stop(self, who: str) -> None:
        """See Backend."""
        self._stop(who)

    async def call(self, name: str, arguments: dict) -> DeskReply:
        """Runs the command in its own thread. Without an answer within LIMIT, it returns a failure."""
        if not self._waiting.acquire(blocking=False):
            return DeskReply(False, f"{MAX_WAITING} earlier requests have not been answered; is the ROS master there?")
        loop = asyncio.get_running_loop()
        done: asyncio.Future[DeskReply] = loop.create_future()

        def give(answer: DeskReply) -> None:
            if not done.done():
                done.set_result(answer)

        def work() -> None:
            try:
                answer = getattr(self, f"_{name}")(**arguments)
            except rospy.ROSException as error:
                answer = DeskReply(False, f"{name}: {error}")
            except Exception as error:  # nothing from outside ends the node
                answer = DeskReply(False, f"{name}: {type(error).__name__}: {error}")
            finally:
                self._waiting.release()
            loop.call_soon_threadsafe(give, answer)

        threading.Thread(target=work, name=f"command_{name}", daemon=True).start()
        try:
            return await asyncio.wait_for(done, LIMIT)
        except TimeoutError:
            return DeskReply(False, f"{name}: no answer within {LIMIT:.0f} s; look at the event log and at Health")

    @staticmethod
    def _ask(service: str, kind: Any, *fields: Any) -> Any:
        return call_service(service, kind, *fields, wait=2.0)

    def _reply(self, service: str, kind: Any, *fields: Any) -> DeskReply:
        answer = self._ask(service, kind, *fields)
        return DeskReply(
            bool(answer.success), answer.message or ("done" if answer.success else "refused without a reason")
        )

    # --- one method per command, in a thread of its own -------------------------------------------------------

    def _start(self, action: str, object_id: str = "", delivery: str = "") -> DeskReply:
        return self._reply("coglab/start", Start, action, f"{object_id}/{delivery}" if delivery else object_id)

    def _calibrate(self, mode: str, force: bool = False) -> DeskReply:
        if self._calibration.get_num_connections() == 0:
            return DeskReply(False, "the hand is not there; look at Health")
        number, before = self._view.hand_number, self._view.hand
        self._calibration.publish(String(mode + (" force" if force else "")))
        refused = ""
        end = time.monotonic() + HAND_LIMIT
        while time.monotonic() < end:
            now = self._view.hand
            if self._view.hand_number > number and now.calibrating:
                return DeskReply(True, f"{now.message}; the event log shows its end")
            if self._view.hand_number > number and now.event_code == ReasonCode.HAND_REFUSED:
                refused = now.message
                # An equal message may belong to an earlier request.
                if refused != before.message:
                    break
            time.sleep(0.02)
        nothing = f"the hand has not answered within {HAND_LIMIT:.0f} s; look at the event log and at Health"
        return DeskReply(False, refused or nothing)

    def _home(self) -> DeskReply:
        home = lookup(self._view.config(), "postures.home")
        if not isinstance(home, list) or len(home) != 7:
            return DeskReply(False, "postures.home is not in the configuration of the machines (/coglab/config_file)")
        answer = self._reply("controller_manager/switch_controller", SwitchController, HOME_CONTROLLER)
        if not answer["success"]:
            return answer
        return self._reply("controller_manager/ptp/add_ptp", AddPtp, [float(value) for value in home], [], [])

    def _speed_scale(self, value: float) -> DeskReply:
        return self._reply("controller_manager/speed_scale", SetSpeedScale, float(value))

    def _contact_learn(self) -> DeskReply:
        return self._reply("contact_detector/learn", Learn)

    def _contact_arm(
        self, mode: str, k: float = 0.0, timeout: float = 10.0, joints: list[int] | None = None
    ) -> DeskReply:
        return self._reply("contact_detector/arm", ArmContact, mode, float(timeout), float(k), joints or [], 0.0, 0.0)

    def _objects_reload(self) -> DeskReply:
        answer = self._reply("object_database/reload", Reload)
        self._view.files_changed()
        return answer

    def _answer(self, questionnaire: str, answers: dict[str, float], of: list[str] | None = None) -> DeskReply:
        from coglab_tools.command import CommandError

        try:
            answer = self._view.study.answer(questionnaire, answers, of)
        except CommandError as error:
            return DeskReply(False, str(error))
        self._view.files_changed()
        return DeskReply(True, answer)

    def _preview(self, primitive: str) -> DeskReply:
        self._view.preview = primitive
        shown = f"the cell shows the path of {primitive} toward the goal of the next action" if primitive else ""
        return DeskReply(True, shown or "the cell shows the path of the next action")

    def _feedback(self, verb: str, name: str) -> DeskReply:
        return self._reply(f"controller_manager/feedback/{verb}", FeedbackSelect, [name], "console")

    def _feedback_order(self, names: list[str]) -> DeskReply:
        return self._reply("controller_manager/feedback/set_execution_order", SetExecutionOrder, names)

    def _parameters(self) -> DeskReply:
        rows: list[list[str]] = []

        def walk(path: str, value: Any) -> None:
            if isinstance(value, dict) and value:
                for key in sorted(value):
                    if not (path == "" and key in HIDDEN):
                        walk(f"{path}/{key}", value[key])
            elif len(rows) < MAX_PARAMETERS:
                rows.append([path, str(value)[:200]])

        walk("", rospy.get_param("/"))
        mark = hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:12]
        return DeskReply(True, f"{len(rows)} parameters; the same mark means the same values: {mark}", rows)


class DirectService(rospy.ServiceProxy):
    """A service proxy that knows the address beforehand. If that address fails, it requests it from the master."""

    address: str | None = None

    def refresh(self) -> None:
        """Requests the address from the master. This waits as long as the master takes."""
        try:
            self.address = rospy.get_master().lookupService(self.resolved_name)[2] or self.address
        except Exception:  # no such service now, or no master: keep the known address
            pass

    def _get_service_uri(self, request: object) -> str:
        address, self.address = self.address, None  # use a stale address only once
        if address:
            try:
                parse_rosrpc_uri(address)
                return address
            except rospy.ServiceException:
                pass
        return super()._get_service_uri(request)


class StopPath:
    """STOP goes three ways at once. None waits for another, for the ROS master, or for the event loop.

    `hold` on the topic lwr/ros_events, `hold` by the service lwr/command, and the service coglab/stop. The topic uses a
    connection that stands already. A thread requests the addresses of the services once a second,
    so that STOP does not need the master.

    Call `press` from any thread; `say(text, level)` gets the outcomes."""

    def __init__(self, say: Callable[[str, str], None]) -> None:
        self._say = say
        self._topic = rospy.Publisher("lwr/ros_events", String, queue_size=5, tcp_nodelay=True)
        self._arm = DirectService("lwr/command", LwrCommand)
        self._brain = DirectService("coglab/stop", Trigger)
        self._waiting = threading.Semaphore(MAX_WAITING_STOPS)
        self._keeper = worker(self._keep, "stop_addresses")
        self._keeper.start()

    def press(self, who: str) -> None:
        """Sends STOP and returns at once. While MAX_WAITING_STOPS services have not answered, only by the topic."""
        self._topic.publish(String("hold"))  # never waits: it has a queue, and a thread per connection
        began = time.monotonic()
        for name, call in (("arm", lambda: self._arm("hold")), ("brain", lambda: self._brain())):
            if self._waiting.acquire(blocking=False):
                threading.Thread(target=self._ask, args=(name, call, began), name=f"stop_{name}", daemon=True).start()
        self._say(f"STOP by {who}", "fault")

    def _ask(self, name: str, call: Callable[[], Any], began: float) -> None:
        watch = threading.Timer(
            STOP_ANSWER_LIMIT,
            self._say,
            (
                f"STOP: the {name} has not answered for {STOP_ANSWER_LIMIT:.0f} s; use the red button of the robot",
                "fault",
            ),
        )
        watch.daemon = True
        watch.start()
        try:
            answer = call()
            took = 1000 * (time.monotonic() - began)
            self._say(f"STOP, {name}: {plain(answer.message)} ({took:.0f} ms)", "info" if answer.success else "fault")
        except Exception as error:
            self._say(f"STOP: the {name} cannot be reached ({error}); if the arm moves, use the red button", "fault")
        finally:
            watch.cancel()
            self._waiting.release()

    def _keep(self) -> None:
        while not rospy.is_shutdown():
            self._arm.refresh()
            self._brain.refresh()
            time.sleep(1.0)
