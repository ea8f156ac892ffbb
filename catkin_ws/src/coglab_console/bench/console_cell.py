"""A simulated cell of its own for the bench: launching, the page's operator by mouse and by keyboard, what ROS says."""

from __future__ import annotations

import math
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rosgraph
import rospkg
import rospy
import tf2_ros
from coglab_console.browser import Browser, acknowledge, press_and_hold
from coglab_msgs.msg import CellTruth, LwrState, MasterState
from coglab_msgs.srv import LwrCommand, PlaceObject
from console_phases import phases_of
from console_rows import say
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Pose
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

MOVES = "return coglab.state().speed > 0.02"
STANDSTILL = ("stopped", "fault")
READY = 120.0  # s until the hub
RECOVERY = 150.0  # s to be in a hub again
LOAD = "(load)"  # the bridge's word for a simulated robot controller that this computer did not run in time
ATTEMPTS = 3
TOWARD = {  # the action that leads toward one, by who holds the object; none where that one can begin
    "exchange_human_to_robot": {"robot": "exchange_robot_to_human", "board": "take"},
    "exchange_robot_to_human": {"human": "exchange_human_to_robot", "board": "take"},
    "take": {"robot": "put", "human": "exchange_human_to_robot"},
    "put": {"human": "exchange_human_to_robot", "board": "take"},
}
STEPS = 8  # until an action can begin
MOVED, TURNED = 0.03, 0.3  # m and rad by which what stands on the board was touched since it was put there
AT_REST, PATIENCE = 0.1, 20.0  # m from where the person's hand rests, and s for which an experimenter waits for that
ANSWERED = """
const rows = coglab.events().filter((e) => e.seq > arguments[0] && e.source === 'stop').map((e) => e.text);
const answers = rows.filter((text) => text.startsWith('STOP, ') || text.includes('cannot be asked')).length;
const presses = rows.filter((text) => text.startsWith('STOP by')).length;
return presses === arguments[1] && answers === 2 * presses && presses;
"""  # the page sends each press by its connection and by a request, the console each to the arm and to the brain
REQUEST_LIMIT = 9.0  # s after which the page gives a request up, see link.js


def free_port() -> int:
    """A TCP port on loopback."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Cell:
    """The launched system; `launch_console` and `end_console` for a console beside it."""

    def __init__(self, console: bool, hosts: str = "") -> None:
        self.home = Path(tempfile.mkdtemp(prefix="coglab-bench-"))
        port = free_port()
        os.environ.update(
            ROS_MASTER_URI=f"http://127.0.0.1:{port}",
            ROS_IP="127.0.0.1",
            ROS_HOME=str(self.home),
            ROS_LOG_DIR=str(self.home / "log"),
            PYTHONUNBUFFERED="1",
        )
        words = ["fri_period:=0.010", f"console:={str(console).lower()}", "console_port:=0", f"console_hosts:={hosts}"]
        launch = Path(rospkg.RosPack().get_path("coglab_bringup"), "launch", "coglab.launch")
        self._log = (self.home / "roslaunch.log").open("w")
        command = ["roslaunch", "-p", str(port), str(launch), *words]
        self._process = subprocess.Popen(command, stdout=self._log, stderr=subprocess.STDOUT)
        self._console: subprocess.Popen | None = None
        self.machine, self.arm = MasterState(), LwrState()
        self.passed: list[str] = []  # states that were entered, see came_to()
        self.structure: dict[str, list[str]] = {}  # children of the machine's containers, by path
        self.fri: dict[str, str] = {}  # newest diagnostics of the connection to the robot controller
        self._on_board: Pose | None = None  # where the robot has put the object on the board
        self.supervisors: list[str] = []  # what the arm's interface was in, one after the other
        self.held_at = 0.0  # s of the bridge's own clock, when the hold latched last
        self.latencies: list[float] = []  # s, as the bridge's diagnostics tell it
        self.answers: list[float] = []  # s, mean answer time, likewise

    def connect(self) -> None:
        """Becomes a node of it and waits for the hub."""
        self.wait(rosgraph.is_master_online, READY, "the ROS master")
        rospy.init_node("console_bench", disable_signals=True)
        self.frames = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self.frames)
        rospy.Subscriber("/coglab/state", MasterState, self._on_machine)
        for topic, kind, heard in (
            ("container_structure", SmachContainerStructure, self._on_structure),
            ("container_status", SmachContainerStatus, self._on_container),
        ):
            rospy.Subscriber(f"/coglab/smach/{topic}", kind, heard, queue_size=200)
        rospy.Subscriber("/lwr/state", LwrState, self._on_arm, tcp_nodelay=True)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics)
        self.wait(lambda: self.machine.in_hub and "wait" in self.machine.state, READY, "the hub")

    def _on_machine(self, message: MasterState) -> None:
        self.machine = message
        self.passed.append(message.state)

    def _on_structure(self, message: SmachContainerStructure) -> None:
        self.structure[message.path] = list(message.children)

    def _on_container(self, message: SmachContainerStatus) -> None:
        # Of states side by side, /coglab/state tells the newest alone.
        self.passed += [f"{message.path}/{label}" for label in message.active_states]

    def phases(self, action: str) -> tuple[list[str], list[str]]:
        """Paths of the phases of an action and of its recovery, from the structure of the machine."""
        self.wait(lambda: any(path.endswith(f"/{action}") for path in list(self.structure)), 20.0, "the structure")
        return phases_of(dict(self.structure), action)

    def came_to(self, state: str) -> bool:
        """Whether the state of this path was entered since `passed` was cleared. TimeoutError where the machine has
        stopped by itself."""
        if self.leaf in STANDSTILL:
            raise TimeoutError(f"{state}: the machine is in {self.leaf}: {self.machine.why}")
        return state in list(self.passed)

    def _on_arm(self, message: LwrState) -> None:
        if message.hold_latched and not self.arm.hold_latched:
            self.held_at = message.header.stamp.to_sec()
        if message.supervisor != self.arm.supervisor:
            self.supervisors.append(message.supervisor)
        self.arm = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith("FRI connection"):
                values = self.fri = {pair.key: pair.value for pair in status.values}
                self.latencies.append(float(values["latency (s)"]))
                self.answers.append(float(values["mean answer time (s)"]))

    def wait(self, ready: Callable[[], bool], limit: float, what: str) -> None:
        """TimeoutError where it does not come, ChildProcessError where the system has ended meanwhile."""
        end = time.monotonic() + limit
        while not ready():
            if self._process.poll() is not None:
                words = Path(self._log.name).read_text().strip().splitlines() or ["nothing"]
                raise ChildProcessError(f"the system has ended before {what}; its last words: {words[-1]}")
            if time.monotonic() > end:
                raise TimeoutError(
                    f"{what} did not come within {limit:.0f} s: {self.machine.state}, {self.machine.why}"
                )
            time.sleep(0.01)

    @property
    def leaf(self) -> str:
        """Label of the active state."""
        return self.machine.state.rsplit("/", 1)[-1]

    def reset_arm(self) -> None:
        """Frees the arm's own latch; the machine stays where it is."""
        rospy.ServiceProxy("/lwr/command", LwrCommand)("reset")
        self.wait(lambda: not self.arm.hold_latched, 10.0, "the end of the hold")

    def holder(self) -> str:
        """Who has the object, by the truth of the cell: robot, human, board or floor."""
        truth = rospy.wait_for_message("/coglab_sim/truth/cell", CellTruth, 5.0)
        return {"both": "robot", "none": "floor"}.get(truth.held_by, truth.held_by)

    def await_person(self) -> None:
        """The person's hand is at rest, as an experimenter sees it before the next action: a STOP leaves people in the
        middle of what they were doing. Goes on where it does not come to rest."""
        rest = rospy.get_param("/coglab_sim/virtual_human/rest")

        def rests() -> bool:
            hand = rospy.wait_for_message("/coglab_sim/truth/cell", CellTruth, 5.0).human_hand.position
            return math.dist((hand.x, hand.y, hand.z), rest) < AT_REST

        try:
            self.wait(rests, PATIENCE, "the person's hand at rest")
        except TimeoutError as error:
            say(str(error))

    def remember_board(self) -> None:
        """The object stands on the board as the robot has put it there."""
        truth = rospy.wait_for_message("/coglab_sim/truth/cell", CellTruth, 5.0)
        if truth.held_by == "board":
            self._on_board = truth.object

    def touched(self) -> bool:
        """Whether the object on the board is not as the robot has put it there: a STOP may have let it fall, or the
        hand may have pushed it."""
        if self._on_board is None:
            return False
        now, then = rospy.wait_for_message("/coglab_sim/truth/cell", CellTruth, 5.0).object, self._on_board
        a, b = now.orientation, then.orientation
        turn = 2.0 * math.acos(min(1.0, abs(a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w)))
        place, before = now.position, then.position
        moved = math.dist((place.x, place.y, place.z), (before.x, before.y, before.z))
        return moved > MOVED or turn > TURNED

    def pick_up(self) -> None:
        """The object to where the robot has put it on the board, as an experimenter would."""
        if self._on_board is None:
            raise TimeoutError("the object lies where nobody has put it, and there is no place on the board for it")
        answer = rospy.ServiceProxy("/coglab_sim/cell/place_object", PlaceObject)("", "world", self._on_board)
        if not answer.success:
            raise TimeoutError(f"the object stays on the floor: {answer.message}")
        say("the object was picked up and laid on the board")

    def launch_console(self) -> None:
        """A console beside the cell."""
        (self.home / "console.url").unlink(missing_ok=True)
        command = ["rosrun", "coglab_console", "console_node.py", "_port:=0"]
        self._console = subprocess.Popen(command, stdout=self._log, stderr=subprocess.STDOUT)

    def end_console(self) -> None:
        """Ends it."""
        if self._console is not None:
            self._console.send_signal(signal.SIGINT)
            self._console.wait(20)
            self._console = None

    def close(self) -> None:
        """Ends everything."""
        try:
            self.end_console()
        finally:
            self._process.send_signal(signal.SIGINT)
            self._process.wait(60)
            self._log.close()
            shutil.rmtree(self.home, ignore_errors=True)


class Operator:
    """Uses the page as a person does, by mouse or by keyboard."""

    def __init__(self, browser: Browser, cell: Cell, pictures: Path) -> None:
        self.browser, self.cell, self.pictures = browser, cell, pictures
        self.touches = False  # as on a tablet
        self._anew = 0  # how often something was begun again because of the load

    def button(self, action: str):
        """The element."""
        return self.browser.driver.find_element(By.CSS_SELECTOR, f"[data-action={action}]")

    def enabled(self, action: str, limit: float = 20.0) -> None:
        """Waits until the page lets it be pressed."""
        self.browser.until(
            "return !document.querySelector(arguments[0]).hasAttribute('aria-disabled')",
            limit,
            f"[data-action={action}]",
        )

    def press(self, action: str, keyboard: bool) -> None:
        """One action."""
        self.enabled(action)
        if keyboard:
            number = self.button(action).text.split()[0]
            self.browser.js("document.activeElement.blur()")
            ActionChains(self.browser.driver).send_keys(number).send_keys(Keys.ENTER).perform()
        elif self.touches:
            self.browser.touch(f"[data-action={action}]")
        else:
            self.button(action).click()

    def stop(self) -> None:
        """Space."""
        ActionChains(self.browser.driver).send_keys(Keys.SPACE).perform()

    def answered(self, since: int) -> None:
        """Waits until every way of the one STOP after event number `since` has its answer: one that is late would hold
        the arm again after a reset, and would pass for the next press."""
        try:
            self.browser.until(ANSWERED, REQUEST_LIMIT + 6.0, since, 2)
        except TimeoutError:
            # Where the connection was just being made anew there was one way alone; the other one comes no more.
            self.browser.until(ANSWERED, 1.0, since, 1)
            say("a press had one way to the console alone")

    def newest_event(self) -> int:
        """Its number."""
        return self.browser.js("return coglab.events().at(-1)?.seq ?? 0")

    def take_control(self) -> None:
        """Another browser may hold the control; it is gone."""
        operating = "return document.getElementById('role').innerText.startsWith('you operate')"
        if not self.browser.js(operating):
            self.browser.js("document.querySelector('#control button').click()")
        self.browser.until(operating, 15.0)

    def distance_to_tf(self) -> float:
        """From the hand in the picture to the hand in tf, m; the arm stands."""
        self.browser.until("return coglab.state().speed < 0.001", 20.0)
        place = self.cell.frames.lookup_transform("world", "ih2_palm", rospy.Time(0), rospy.Duration(5.0))
        there = place.transform.translation
        return math.dist(self.browser.js("return coglab.palm()"), (there.x, there.y, there.z))

    def do(self, action: str, keyboard: bool, name: str) -> bool:
        """One action from hub to hub; whether it succeeded."""
        self.press(action, keyboard)
        self.cell.wait(lambda: not self.cell.machine.in_hub, 15.0, f"the begin of {action}")
        self.cell.wait(lambda: self.cell.machine.in_hub or self.browser.js(MOVES), 60.0, f"the motion of {action}")
        self.browser.picture(self.pictures / f"{name}.png")
        self.cell.wait(lambda: self.cell.machine.in_hub, 90.0, f"the end of {action}")
        wanted = "wait_with_object" if action in ("exchange_human_to_robot", "take") else "wait_without_object"
        done = self.cell.leaf == wanted
        if done and action == "put":
            self.cell.remember_board()
        if not done:
            say(f"{action} ended in {self.cell.leaf}: {self.cell.machine.why or 'no reason told'}")
        return done

    def carry_out(self, action: str, keyboard: bool, name: str) -> bool:
        """As do(), and begun anew where the computer was too busy."""

        def once() -> bool:
            try:
                self.bring_to(action)
                return self.do(action, keyboard, name)
            except TimeoutError as error:
                say(f"{action}: {error}")
                return False

        return self.unless_crowded(once, bool)

    def unless_crowded(self, work: Callable[[], Any], good: Callable[[Any], bool]) -> Any:
        """What the work gives; done again, ATTEMPTS in all, where it is not good because the load of this computer took
        command mode from the simulated robot controller."""
        for left in reversed(range(ATTEMPTS)):
            found = work()
            if good(found) or LOAD not in self.cell.machine.why or not left:
                break
            self._anew += 1
            self.recover()
        return found

    def crowded(self) -> str:
        """For the name of a row: how often something was begun anew since the last call."""
        words = f", {self._anew} begun anew (load)" if self._anew else ""
        self._anew = 0
        return words

    def recover(self) -> None:
        """To a hub that takes actions, whatever an attempt has left behind; on a crowded computer the simulated
        controller may lose command mode on the way, so more than once."""
        end = time.monotonic() + RECOVERY
        while not (self.cell.machine.in_hub and self.cell.leaf.startswith("wait_")):
            try:
                if self.cell.leaf in STANDSTILL:
                    self.go_on()
                self.cell.wait(lambda: self.cell.machine.in_hub, 60.0, "the hub")
            except TimeoutError:
                if time.monotonic() > end:
                    raise

    def bring_to(self, action: str) -> None:
        """The hub that offers this action, with the object where it has to be; what a STOP let fall is picked up."""
        for _ in range(STEPS):
            self.recover()
            holder = self.cell.holder()
            if holder == "floor" or (holder == "board" and self.cell.touched()):
                self.cell.pick_up()
                continue
            step = TOWARD[action].get(holder, "")
            offered = self.cell.machine.actions
            if not step and action in offered:
                self.cell.await_person()
                return
            self.do(step if step in offered else offered[0], False, "between")
        raise TimeoutError(f"{action} was not offered, with the object held by {holder}")

    def _acknowledge(self) -> None:
        if self.touches:
            self.browser.touch("#acknowledge")
        else:
            self.browser.driver.find_element(By.ID, "acknowledge").click()

    def go_on(self) -> None:
        """Acknowledge where that is still to be done, then hold the button that leads on, and wait for the hub."""
        self.cell.wait(lambda: self.cell.leaf in STANDSTILL, 15.0, "stopped")
        leaf = self.cell.leaf
        self.browser.until("return coglab.docs().desk.guard.hold", 5.0)
        acknowledge(self.browser, self._acknowledge)
        action = "reset" if leaf == "stopped" else "initialise"
        self.enabled(action)
        if self.touches:
            self.browser.touch(f"[data-action={action}]", lambda: self.cell.leaf != leaf, 8.0)
        else:
            press_and_hold(self.browser, self.button(action), lambda: self.cell.leaf != leaf, 8.0)
        self.cell.wait(lambda: self.cell.machine.in_hub and self.cell.leaf.startswith("wait_"), 60.0, "the hub")
