"""Records one trial: the data for its result and its plot.

It reads the true state of the simulation, but only to measure, not to control.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rospy
from coglab.series import Series
from coglab_msgs.msg import CellTruth, Contact, DmpFeedback, HandStatus, Transition
from coglab_py.messages import pose_of
from coglab_py.steady import Stamps
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from coglab_bringup.reach_errors import GIVES, reach_errors

FORCE_THRESHOLD = 0.3  # N on palm and fingers; a larger true force counts as touch
LOST_KEYS = ("measurements lost", "answers lost")  # diagnostics of the bridge that count lost FRI packets


class TrialRecorder:
    """Subscribes to the topics of a running system and fills a Series until `stop()`."""

    def __init__(self) -> None:
        self.trial = Series()
        self.changed = threading.Condition()
        self._time = Stamps().steady
        self._subscribers = [
            rospy.Subscriber("/lwr/joint_states", JointState, self._on_joints, queue_size=400),
            rospy.Subscriber("/lwr/external_torques", JointState, self._on_torques, queue_size=400),
            rospy.Subscriber("/coglab_sim/truth/cell", CellTruth, self._on_truth, queue_size=400),
            rospy.Subscriber("/ih2_hand/hand_status", HandStatus, self._on_hand, queue_size=100),
            rospy.Subscriber("/controller_manager/dmp/feedback", DmpFeedback, self._on_feedback, queue_size=100),
            rospy.Subscriber("/coglab/transitions", Transition, self._on_transition, queue_size=100),
            rospy.Subscriber("/coglab/contact", Contact, self._on_contact, queue_size=100),
            rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics, queue_size=10),
        ]

    def stop(self) -> Series:
        """Stop recording and return the complete trial."""
        for subscriber in self._subscribers:
            subscriber.unregister()
        return self.trial

    def wait_for(self, condition: Callable[[], bool], limit: float) -> bool:
        """Wait until `condition()` is true, up to `limit` (s of the steady clock). True if it is."""
        with self.changed:
            return bool(self.changed.wait_for(lambda: condition() or rospy.is_shutdown(), limit)) and condition()

    def _on_joints(self, message: JointState) -> None:
        self.trial.joints.append((self._time(message.header.stamp), message.position, message.velocity))

    def _on_torques(self, message: JointState) -> None:
        self.trial.external_torques.append((self._time(message.header.stamp), message.effort))

    def _on_truth(self, message: CellTruth) -> None:
        points = [
            message.robot_hand.position,
            message.human_hand.position,
            message.object.position,
            message.touch_force,
        ]
        robot, human, thing, force = ([p.x, p.y, p.z] for p in points)
        stamp = self._time(message.header.stamp)
        self.trial.truth.append((stamp, robot, human, thing, float(np.linalg.norm(force))))
        self.trial.poses.append((stamp, *map(pose_of, (message.robot_hand, message.human_hand, message.object))))

    def _on_hand(self, message: HandStatus) -> None:
        if len(message.motors) == 5:
            self.trial.fingers.append((self._time(message.header.stamp), [motor.position for motor in message.motors]))

    def _on_feedback(self, message: DmpFeedback) -> None:
        self.trial.feedback.append((self._time(message.header.stamp), message.state, message.remaining_distance))

    def _on_transition(self, message: Transition) -> None:
        with self.changed:
            row = (message.path, message.from_state, message.outcome, message.to_state)
            stamp = self._time(message.header.stamp)
            self.trial.transitions.append((stamp, *row, message.reason, message.reason_code))
            self.changed.notify_all()

    def _on_contact(self, message: Contact) -> None:
        words = f"{message.source}: {message.message}"
        self.trial.contacts.append((self._time(message.header.stamp), message.contact, message.margin, words))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        counts = [int(value.value) for status in message.status for value in status.values if value.key in LOST_KEYS]
        if counts:
            self.trial.fri_lost.append((self._time(message.header.stamp), sum(counts)))


def summarise(
    trial: Series,
    kind: str,
    outcome: str,
    start: float,
    end: float,
    velocity_limits: np.ndarray,
    entry: Mapping[str, Any] | None = None,
) -> dict:
    """The values of one handover between `start` and `end` (s) for result.json. `entry`: the database entry of the
    object that is handed over; None: unknown.

    final_error_mm, final_error_deg, reaches: see reach_errors(). believed_error_mm: distance of the hand from the goal
    that the motion latched at its end, as the controller publishes it, for motions that end as `reached`.
    contact_delay_ms: from the first true touch to the detector's sample. fri_lost: FRI packets lost during the
    handover, as the bridge publishes it once a second. peak_velocity_share: largest joint speed divided by its limit.
    Values without a measurement are None (the machine waits for no contact when the robot gives).
    """
    contact = next((t for t, found, *_ in trial.contacts if found and start <= t <= end), None)
    until = next(
        (t for t, *_ in trial.contacts if start <= t <= end), end
    )  # after a contact or a release the arm moves home
    # A motion in the state "holding" is in progress: its goal is not visible at the moment.
    arrived = [d for t, state, d in trial.feedback if start <= t <= until and state == "reached"]
    touch = next((t for t, *_, force in trial.truth if start <= t <= end and force > FORCE_THRESHOLD), None)
    delay = contact - touch if contact and touch else None
    if kind == GIVES:  # the object touches the hand from the beginning
        delay = None
    lost_before = [count for t, count in trial.fri_lost if t <= start] or [count for _, count in trial.fri_lost][:1]
    lost_until = [count for t, count in trial.fri_lost if t <= end + 1.0]
    speeds = np.array([velocity for t, _, velocity in trial.joints if start <= t <= end])
    share = float(np.max(np.abs(speeds) / velocity_limits)) if speeds.size else None
    return {
        "kind": kind,
        "outcome": outcome,
        "duration_s": round(end - start, 3),
        **reach_errors(trial, kind, entry, start, end),
        "believed_error_mm": round(1000.0 * arrived[-1], 3) if arrived else None,
        "contact_delay_ms": round(1000.0 * delay, 1) if delay is not None else None,
        "fri_lost": lost_until[-1] - lost_before[-1] if lost_until and lost_before else None,
        "peak_velocity_share": round(share, 4) if share is not None else None,
    }
