"""Return values of the robot's methods: frozen records with a reason code, a sentence and times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose

_NAMES = {value: name for name, value in vars(ReasonCode).items() if name.isupper() and isinstance(value, int)}

ACTIONS = {
    "receive": "exchange_human_to_robot",
    "give": "exchange_robot_to_human",
    "take": "take",
    "put": "put",
}
"""Short name of each action -> its name in the state machines."""


def reason_name(code: int) -> str:
    """Returns the name of a coglab_msgs/ReasonCode, such as "GOAL_LOST"; the number as text if it is unknown."""
    return _NAMES.get(int(code), str(code))


class Refused(RuntimeError):
    """A request was refused before anything moved. The sentence has the next step.

    ``code``: its coglab_msgs/ReasonCode. ``name``: the name of the code.
    """

    def __init__(self, sentence: str, code: int = ReasonCode.NONE) -> None:
        super().__init__(sentence)
        self.code = int(code)

    @property
    def name(self) -> str:
        return reason_name(self.code)


@dataclass(frozen=True)
class Result:
    """End of one request. ``bool(result)`` is ``result.ok``. Times in s: virtual time of a World, ROS time of a running
    robot."""

    what: str
    """the request, such as "receive" or "move_joints" """
    ok: bool
    code: int = ReasonCode.NONE
    """coglab_msgs/ReasonCode; 0 after success"""
    sentence: str = ""
    """reason of the failure; empty after success"""
    causes: tuple[str, ...] = ()
    """causes of the reason, nearest first"""
    started: float = 0.0
    ended: float = 0.0

    def __bool__(self) -> bool:
        return self.ok

    @property
    def reason(self) -> str:
        """Name of the code, such as "NOT_RELEASED"; "NONE" after success."""
        return reason_name(self.code)

    @property
    def duration(self) -> float:
        """s"""
        return self.ended - self.started

    def __str__(self) -> str:
        if self.ok:
            return f"{self.what}: done in {self.duration:.2f} s"
        because = "".join(f", because {cause}" for cause in self.causes)
        return f"{self.what}: {self.reason} ({self.code}): {self.sentence}{because}"


@dataclass(frozen=True)
class Exchange(Result):
    """End of one action of the state machines: receive, give, take or put."""

    object_id: str = ""
    outcome: str = ""
    """"succeeded"; "failed_empty" or "failed_holding": the hand is empty or holds the object; "stopped" or "fault":
    call ``robot.reset()``"""
    marks: Mapping[str, float] = field(default_factory=dict)
    """times of events, s: "offered", "motion_started", "contact", "closed", "released", ..."""


@dataclass(frozen=True, eq=False)
class MotionResult(Result):
    """End of one motion of the arm."""

    joints: np.ndarray = field(default_factory=lambda: np.full(7, np.nan))
    """measured joint positions at the end, rad, shape (7,), wire order a1 a2 e1 a3 a4 a5 a6"""
    palm: Pose = Pose()
    """pose of the palm at the end, base frame"""
    remaining: float = 0.0
    """m, distance from the palm to the goal; motions in joint space: rad, largest error of a joint"""


@dataclass(frozen=True)
class Event:
    """One event of the state machines. ``kind``: "transition", "result" or "said" (to the person)."""

    time: float
    """s, as in Result"""
    kind: str
    sentence: str
    code: int = ReasonCode.NONE
    """coglab_msgs/ReasonCode of the reason; coglab_msgs/Say for "said" """
    path: str = ""
    """container of a transition, such as "/coglab_master/take" """
    from_state: str = ""
    outcome: str = ""
    to_state: str = ""


@dataclass(frozen=True, eq=False)
class RobotState:
    """State of robot and brain at one moment."""

    time: float
    """s, as in Result"""
    state: str
    """path of the innermost active state; empty without a brain"""
    actions: tuple[str, ...]
    """actions that the brain accepts now: names of ``coglab.ACTIONS``, own actions, "reset" or "initialise"; empty
    while an action runs"""
    holding: str
    """id of the object in the robot's hand; empty if the hand is empty"""
    why: str
    """the newest failure; empty if nothing failed"""
    code: int
    """coglab_msgs/ReasonCode of ``why``"""
    waits_for: str
    """awaited event of the brain; empty if none"""
    can_move: bool
    """the arm follows motions now"""
    blocked_by: str
    """why the arm does not follow motions; empty if it does"""
    standing: bool
    """the arm's set-point stands still"""
    joints: np.ndarray
    """measured, rad, shape (7,); NaN if unknown"""
    palm: Pose
    """base frame; NaN if unknown"""
    fingers: tuple[int, ...]
    """positions of five motors, 0 open .. 254 closed; empty if unknown"""

    @property
    def reason(self) -> str:
        """Name of the code."""
        return reason_name(self.code)
