"""The four hand actions with one mailbox: at most one goal moves the fingers.

Four SimpleActionServers would run their goals independently, move the fingers against each other,
and lose a cancel that arrives between two goals. Here every goal, cancel, stop, calibration request
and hand_status enters one queue. One thread processes it, so their order is fixed. Only this thread
uses the goal handles.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import actionlib
import rospy
from coglab_msgs.msg import (
    HandCloseAction,
    HandCloseFeedback,
    HandCloseResult,
    HandOpenAction,
    HandOpenFeedback,
    HandOpenResult,
    HandPreshapeAction,
    HandPreshapeCloseAction,
    HandPreshapeCloseFeedback,
    HandPreshapeCloseResult,
    HandPreshapeFeedback,
    HandPreshapeResult,
    HandStatus,
)
from coglab_py.action_server import ActionServer
from coglab_py.pace import Pace
from coglab_py.steady import ending, worker

from ih2_hand.errors import HandError
from ih2_hand.progress import RESENDS, MotorVerdict, Task
from ih2_hand.reasons import Reason, reason_of

SETTLE_S = 0.02  # s after a command in which a poll may still show the status before it
# s of the cell, longest time between two polls that counts: on a busy computer a finger may have moved in a longer gap
LONGEST_GAP_S = 0.1
BACKLOG = 50  # waiting requests other than goals
SENDING_S = 0.1  # s that a result published at shutdown needs to leave the process
SILENCE_S = 1.5  # s without hand_status after which a goal is aborted

SPECS: dict[str, tuple[Any, Any, Any]] = {
    "hand_open": (HandOpenAction, HandOpenResult, HandOpenFeedback),
    "hand_close": (HandCloseAction, HandCloseResult, HandCloseFeedback),
    "hand_preshape": (HandPreshapeAction, HandPreshapeResult, HandPreshapeFeedback),
    "hand_preshape_close": (HandPreshapeCloseAction, HandPreshapeCloseResult, HandPreshapeCloseFeedback),
}
"""Types of action, result and feedback by action name."""


@dataclass(frozen=True)
class Item:
    """One entry of the mailbox. `kind` is goal, cancel, stop, status, call or quit. `name` is the name
    of the action, or the reason of a stop."""

    kind: str
    name: str = ""
    content: Any = None


@dataclass
class Running:
    """The goal that moves the fingers. Times are monotonic (s)."""

    name: str
    handle: Any
    task: Task
    begun: float
    sent: float
    last_status: float
    driver: Any = None
    fillers: int = 0
    resends: int = 0
    looked: float = 0.0  # start of the last poll
    watched: float = 0.0  # s of the cell since the command; a gap between polls counts at most LONGEST_GAP_S


class GoalQueue:
    """Runs one goal at a time. `owner` is the hand node (driver, preshape and events). The limits of a movement pass
    with `pace`, because the simulated cell moves the fingers of an emulated hand."""

    def __init__(self, owner: Any, pace: Pace):
        self._owner, self._pace = owner, pace
        self._mailbox: queue.Queue[Item] = queue.Queue()
        self._running: Running | None = None
        self._newest: Any = None  # the last goal that arrived
        self._servers = {}
        for name, (action, _, _) in SPECS.items():
            self._servers[name] = ActionServer(
                rospy.resolve_name("~" + name),
                action,
                lambda handle, name=name: self._on_goal(name, handle),
                lambda handle, name=name: self._mailbox.put(Item("cancel", name, handle)),
                auto_start=False,
            )
        self._thread = worker(self._work, "goals")

    def start(self) -> None:
        """Start the action servers."""
        self._thread.start()
        for server in self._servers.values():
            server.start()

    def shutdown(self) -> None:
        """Abort the running goal and end the thread, within 1.1 s. Sends the result before it returns."""
        was_running = self._running is not None
        self._mailbox.put(Item("quit"))
        if threading.current_thread() is not self._thread:
            self._thread.join(1.0)
        if was_running:
            time.sleep(SENDING_S)

    @property
    def active(self) -> str | None:
        """Name of the running action, or None."""
        running = self._running
        return running.name if running else None

    def stop(self, reason: str) -> None:
        """Abort the running goal and stop the fingers."""
        self._mailbox.put(Item("stop", reason))

    def call(self, function: Callable[[], None]) -> None:
        """Run a function in the goals' thread, between the steps of goals. Dropped if BACKLOG requests wait."""
        if self._mailbox.qsize() < BACKLOG:
            self._mailbox.put(Item("call", content=function))
        else:
            rospy.logwarn_throttle(1.0, "hand: %d requests wait; further ones are dropped", BACKLOG)

    def polled(self, status: HandStatus, begun: float) -> None:
        """Pass a poll of the hand, which began at `begun` (monotonic, s), to the running goal."""
        if self._running:
            self._mailbox.put(Item("status", content=(status, begun)))

    def _on_goal(self, name: str, handle: Any) -> None:
        self._newest = handle
        self._mailbox.put(Item("goal", name, handle))

    # -- the thread ------------------------------------------------------------------------------

    def _work(self) -> None:
        while not rospy.is_shutdown():
            try:
                item = self._mailbox.get(timeout=0.1)
            except queue.Empty:
                item = Item("tick")
            try:
                if item.kind == "quit":
                    self._end_running("the node ends", Reason.CANCELLED)
                    return
                self._handle(item)
            except HandError as error:
                self._fail(f"{error}", error.reason)
            except Exception as error:  # a goal must end after any error
                if ending():
                    continue  # the topics are closed; only `quit` is left
                rospy.logerr("hand action: unexpected %s: %s", type(error).__name__, error)
                self._fail(f"internal error: {error}", Reason.UNEXPECTED)

    def _handle(self, item: Item) -> None:
        running = self._running
        if item.kind == "goal":
            if running:
                self._cancel("replaced by a new goal; fingers stopped", Reason.SUPERSEDED)
            if item.content is self._newest:
                self._accept(item.name, item.content)
            else:  # newer goals wait: a flood of goals must not make the hand execute replaced ones
                item.content.set_accepted()
                replaced = MotorVerdict("replaced by a new goal before it began", reason=Reason.SUPERSEDED)
                item.content.set_canceled(_result(item.name, replaced), replaced.text)
        elif item.kind == "cancel":
            if running and item.content == running.handle:
                self._cancel("preempted; fingers stopped", Reason.CANCELLED)
        elif item.kind == "stop":
            self._end_running(item.name, Reason.STOPPING)
        elif item.kind == "call":
            item.content()
        elif running:
            if item.kind == "status":
                self._step(running, *item.content)
            if self._running is running:
                self._watch_time(running)

    def _end_running(self, text: str, reason: Reason) -> None:
        if self._running:
            self._stop_fingers()
            self._fail(text, reason)

    def _accept(self, name: str, handle: Any) -> None:
        handle.set_accepted()
        try:
            task = self._owner.make_task(name, handle.get_goal())
        except (ValueError, HandError) as error:
            self._finish_handle(name, handle, MotorVerdict(str(error), reason=reason_of(error)))
            return
        if handle.get_goal_status().status == actionlib.GoalStatus.PREEMPTING:
            cancelled = MotorVerdict("cancelled before it began", reason=Reason.CANCELLED)
            handle.set_canceled(_result(name, cancelled))
            return
        now = time.monotonic()
        self._running = Running(name, handle, task, now, now, now)
        self._begin(self._running)

    def _begin(self, running: Running) -> None:
        driver = self._owner.connected_driver()
        running.driver = driver
        running.fillers = driver.counters.fillers  # before the command, so that a StopALL during it counts
        running.task.begin(driver)
        running.sent = time.monotonic()
        if not running.resends:
            running.begun = running.sent

    def _step(self, running: Running, status: HandStatus, begun: float) -> None:
        running.last_status = time.monotonic()
        since = max(running.looked, running.begun)
        running.looked = max(begun, since)
        running.watched += min(self._pace.at(running.looked) - self._pace.at(since), LONGEST_GAP_S)
        if not status.connected:
            self._fail(status.message, Reason.HAND_LINK_LOST)
            return
        if self._owner.driver is not running.driver:
            self._fail(f"the connection to {self._owner.port} was lost during the goal", Reason.HAND_LINK_LOST)
            return
        if running.driver.counters.fillers != running.fillers:
            self._resend(running)
            return
        if not status.motors or begun - running.sent < SETTLE_S:
            return
        verdict = running.task.judge(status.motors, running.watched)
        _, _, feedback = SPECS[running.name]
        running.handle.publish_feedback(
            feedback(verdict.text, verdict.status_code, [motor.position for motor in status.motors])
        )
        if verdict.done:
            if verdict.stop:
                self._stop_fingers()
            self._owner.task_ended(running.task, verdict)
            self._finish(verdict)

    def _resend(self, running: Running) -> None:
        """A resynchronisation sent StopALL and stopped the fingers: send the goal's command again."""
        if running.resends >= RESENDS:
            self._stop_fingers()
            self._fail(
                f"the line to {self._owner.port} had to be resynchronised "
                f"{RESENDS + 1} times during the goal: check the cable",
                Reason.HAND_LINK_LOST,
            )
            return
        running.resends += 1
        self._begin(running)

    def _watch_time(self, running: Running) -> None:
        now = time.monotonic()
        if now - running.last_status > SILENCE_S:
            self._stop_fingers()
            self._fail(f"no hand_status for {SILENCE_S} s from {self._owner.port}", Reason.HAND_LINK_LOST)
        elif self._pace.at(now) - self._pace.at(running.begun) > running.task.limit:
            self._stop_fingers()
            self._fail(f"not done within {running.task.limit:.0f} s; fingers stopped", Reason.TIME_LIMIT)

    # -- ends ------------------------------------------------------------------------------------

    def _stop_fingers(self) -> None:
        try:
            driver = self._owner.driver
            if driver:
                driver.stop_all()
        except HandError as error:
            rospy.logwarn("fingers could not be stopped: %s", error)

    def _cancel(self, text: str, reason: Reason) -> None:
        running, verdict = self._running, MotorVerdict(text, done=True, reason=reason)
        self._stop_fingers()
        self._running = None
        assert running is not None
        self._owner.task_ended(running.task, verdict)
        running.handle.set_canceled(_result(running.name, verdict), text)

    def _fail(self, text: str, reason: Reason) -> None:
        if self._running:
            verdict = MotorVerdict(text, done=True, reason=reason)
            self._owner.task_ended(self._running.task, verdict)
            self._finish(verdict)

    def _finish(self, verdict: MotorVerdict) -> None:
        running = self._running
        self._running = None
        assert running is not None
        self._finish_handle(running.name, running.handle, verdict)

    def _finish_handle(self, name: str, handle: Any, verdict: MotorVerdict) -> None:
        result = _result(name, verdict)
        if verdict.ok:
            handle.set_succeeded(result, verdict.text)
        else:
            rospy.logwarn("%s: %s", name, verdict.text)
            handle.set_aborted(result, verdict.text)


def _result(name: str, verdict: MotorVerdict) -> Any:
    return SPECS[name][1](isOk=verdict.ok, reason_code=int(verdict.reason), message=verdict.text)
