"""The action coglab/handover: requests an action of the brain as /coglab/start does, and returns its result.

One thread runs the accepted goal. The class needs no ROS master: tests use their own goal handles.
"""

from __future__ import annotations

import math
import threading
import traceback
from collections.abc import Callable
from typing import Any

import rospy
from coglab_msgs.msg import HandoverFeedback, HandoverGoal, HandoverMark, HandoverResult, ReasonCode
from coglab_py.actions import SHORT_NAMES, WAYS_OUT
from coglab_py.steady import ending

from coglab_smach.context.context import Context
from coglab_smach.context.journal import ActionRecord
from coglab_smach.context.requests import TriggerReply, ask_for

POLL = 0.02  # s between two looks at the brain
FEEDBACK_PERIOD = 0.2  # s between two feedback messages without a change
LONGEST = 3600.0  # s, largest wait and time limit
TIME_LIMIT = 60.0  # s, time limit of a goal that names none
STOPPING = 10.0  # s for the action to end after STOP
UNTAKEN = 0.5  # s in which a hub begins an accepted action
LONGEST_TEXT = 64  # characters of a field


class HandoverServer:
    """Runs one goal at a time. The callbacks of an action server are ``on_goal`` and ``on_cancel``.

    ``stop(reason)``: STOP of the brain. ``stamp(s)``: ROS time of a time of the brain's clock. ``utc(s)``: date and
    time of it. ``spawn(function)``: runs a function in a thread.
    """

    def __init__(
        self,
        ctx: Context,
        stop: Callable[[str], object],
        stamp: Callable[[float], rospy.Time],
        utc: Callable[[float], str],
        spawn: Callable[[Callable[[], None]], object],
    ) -> None:
        self._ctx, self._stop, self._stamp, self._utc, self._spawn = ctx, stop, stamp, utc, spawn
        self._lock = threading.Lock()
        self._handle: Any = None  # goal that waits or runs
        self._begun = False  # the hub has accepted it
        self._cancelled = False
        self._ended: HandoverResult | None = None

    def on_goal(self, handle: Any) -> None:
        """A goal has arrived: run it, or reject it while another one runs."""
        with self._lock:
            other = self._handle
            if other is None:
                self._handle, self._begun, self._cancelled, self._ended = handle, False, False, None
        if other is not None:
            self._reject(handle, TriggerReply(False, self._busy(other.get_goal()), ReasonCode.BUSY))
            return
        self._spawn(lambda: self._run(handle))

    def on_cancel(self, handle: Any) -> None:
        """The client, or somebody else, cancels a goal."""
        with self._lock:
            self._cancelled = self._cancelled or handle == self._handle

    def result_of(self, record: ActionRecord) -> HandoverResult:
        """Returns the message for an action that has ended. It is also the result of the goal that requested it."""
        with self._lock:
            goal = self._handle.get_goal() if self._handle is not None and self._begun else HandoverGoal()
            asked = SHORT_NAMES.get(goal.action, goal.action) == record.kind
            result = HandoverResult(
                id=f"{self._utc(record.started)}_{record.kind}",
                action=record.kind,
                object_id=record.object_id,
                success=record.outcome == "succeeded",
                outcome=record.outcome,
                reason_code=record.code,
                reason=record.reason,
                causes=list(record.causes),
                holding=self._ctx.holding,
                started=self._stamp(record.started),
                ended=self._stamp(record.ended),
                duration=record.ended - record.started,
                marks=[
                    HandoverMark(name, self._stamp(when))
                    for name, when in sorted(record.marks.items(), key=lambda mark: mark[1])
                ],
            )
            if asked:
                result.participant, result.condition = goal.participant, goal.condition
                self._ended = result
            result.header.stamp, result.delivery = result.ended, record.delivery
        return result

    # --- the thread of a goal ---

    def _run(self, handle: Any) -> None:
        try:
            answer = self._unfit(handle.get_goal()) or self._ask(handle)
            if answer is None:
                handle.set_canceled(self._refused(handle, ReasonCode.CANCELLED, "cancelled before it began"), "")
            elif not answer.ok:
                self._reject(handle, answer)
            else:
                self._follow(handle)
        except Exception as error:  # nothing from outside ends the node
            if ending():
                return
            rospy.logerr("coglab/handover: %s", traceback.format_exc())
            code, what = ReasonCode.UNEXPECTED, f"{type(error).__name__}: {error}"
            handle.set_aborted(self._refused(handle, code, what), what)
        finally:
            with self._lock:
                self._handle = None

    @staticmethod
    def _unfit(goal: HandoverGoal) -> TriggerReply | None:
        """Returns the refusal of a goal with a value out of range; None if all values fit."""
        for name, value in (("wait", goal.wait), ("time_limit", goal.time_limit)):
            if not (math.isfinite(value) and 0.0 <= value <= LONGEST):
                return TriggerReply(
                    False, f"{name}: 0 .. {LONGEST:.0f} s is expected, got {value:g}", ReasonCode.OUT_OF_RANGE
                )
        for name in ("action", "object_id", "delivery", "participant", "condition"):
            if len(getattr(goal, name)) > LONGEST_TEXT:
                return TriggerReply(
                    False, f"{name}: at most {LONGEST_TEXT} characters are expected", ReasonCode.OUT_OF_RANGE
                )
        if not goal.action:
            return TriggerReply(
                False, "action: a name is expected, such as receive or give", ReasonCode.INVALID_ARGUMENT
            )
        return None

    def _ask(self, handle: Any) -> TriggerReply | None:
        """Wait until a hub takes the action, at most ``wait`` s. Returns its answer; None if the goal was cancelled."""
        goal, clock = handle.get_goal(), self._ctx.clock
        end = clock.now() + goal.wait
        while not self._cancelled:
            with self._lock:
                self._begun = True  # its record may come before this call returns
            answer = ask_for(self._ctx, goal.action, goal.object_id, "a client", goal.delivery)
            if answer.ok:
                return answer
            with self._lock:
                self._begun = False
            if answer.code not in (ReasonCode.WRONG_STATE, ReasonCode.BUSY) or clock.now() >= end:
                return answer
            clock.sleep(POLL)
        return None

    def _follow(self, handle: Any) -> None:
        """Accept the goal, publish its phases and end it with the result of the action."""
        goal, ctx = handle.get_goal(), self._ctx
        begun = ctx.clock.now()
        limit = goal.time_limit or TIME_LIMIT
        handle.set_accepted("")
        told, at, stopped, idle_since = "", -math.inf, math.inf, math.inf
        timed_out = False
        while True:
            now = ctx.clock.now()
            if stopped == math.inf and (self._cancelled or now - begun > limit):
                timed_out, stopped = not self._cancelled, now
                why = f"its time limit of {limit:g} s is over" if timed_out else "its client has cancelled it"
                self._stop(f"{goal.action}: {why}")
            idle_since = min(idle_since, now) if ctx.requests.idle() else math.inf
            if now - idle_since >= (0.0 if self._ended is not None else UNTAKEN) or now - stopped > STOPPING:
                break
            phase = next(reversed(ctx.journal.active()), "")
            if phase != told or now - at >= FEEDBACK_PERIOD:
                told, at = phase, now
                handle.publish_feedback(self._feedback(phase, now - begun))
            ctx.clock.sleep(POLL)
        result = self._ended or self._without_record(goal, begun)
        if timed_out and not result.success:
            result.reason_code = ReasonCode.TIME_LIMIT
        if result.success:
            handle.set_succeeded(result, "")
        elif self._cancelled:
            handle.set_canceled(result, result.reason)
        else:
            handle.set_aborted(result, result.reason)

    def _feedback(self, phase: str, elapsed: float) -> HandoverFeedback:
        wait = self._ctx.journal.wait()
        left = max(0.0, wait.deadline - self._ctx.clock.now()) if wait.what else 0.0
        return HandoverFeedback(phase, wait.what, wait.code, elapsed, left)

    def _without_record(self, goal: HandoverGoal, begun: float) -> HandoverResult:
        """Returns the result of a request that has left no record: reset and initialise, or an action that the hub
        dropped because it was stopped first."""
        hub, failure = self._ctx.requests.hub(), self._ctx.journal.newest_failure()
        success = goal.action in WAYS_OUT and hub not in ("stopped", "fault", "")
        result = HandoverResult(
            action=SHORT_NAMES.get(goal.action, goal.action),
            object_id=goal.object_id,
            participant=goal.participant,
            condition=goal.condition,
            success=success,
            outcome="succeeded" if success else hub or "fault",
            reason_code=ReasonCode.NONE if success else failure.code or ReasonCode.WRONG_STATE,
            reason="" if success else str(failure) or f"the brain did not begin '{goal.action}'",
            holding=self._ctx.holding,
            started=self._stamp(begun),
            ended=self._stamp(self._ctx.clock.now()),
            duration=self._ctx.clock.now() - begun,
        )
        result.header.stamp = result.ended
        return result

    # --- refusals ---

    def _busy(self, running: HandoverGoal) -> str:
        phase = next(reversed(self._ctx.journal.active()), "")
        return f"a handover of another client runs ('{running.action}', {phase}): wait for its end, or cancel it"

    def _refused(self, handle: Any, code: int, reason: str) -> HandoverResult:
        goal = handle.get_goal()
        result = HandoverResult(
            action=goal.action[:LONGEST_TEXT],
            object_id=goal.object_id[:LONGEST_TEXT],
            outcome="refused",
            reason_code=code,
            reason=reason,
            holding=self._ctx.holding,
            started=self._stamp(self._ctx.clock.now()),
        )
        result.ended = result.header.stamp = result.started
        return result

    def _reject(self, handle: Any, answer: TriggerReply) -> None:
        handle.set_rejected(self._refused(handle, answer.code, answer.message), answer.message)
