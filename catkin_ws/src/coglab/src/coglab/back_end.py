"""What a Robot needs from its cell. Two back ends have it: ``world`` (virtual time) and ``running`` (ROS)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from coglab_py.pose import Pose
from coglab_smach.context.master_state import MasterState
from coglab_smach.context.requests import TriggerReply
from coglab_smach.ports.interfaces import ArmPort, HandPort

from coglab.results import Event, Exchange


class BackEnd(Protocol):
    """A cell with an arm, perhaps with a hand and a brain. Times in s; poses in the base frame of the arm."""

    @property
    def arm(self) -> ArmPort: ...

    @property
    def hand(self) -> HandPort | None:
        """None: this robot has no hand."""

    @property
    def actions(self) -> Mapping[str, str]:
        """Short name of each action of the brain -> its name there. Empty: this robot has no brain."""

    def check(self) -> None:
        """RuntimeError with a reason if the cell cannot be used now: closed, or from another thread or process."""

    def now(self) -> float:
        """Returns the time, s."""

    def clock(self) -> float:
        """Returns the time for time limits, s: it passes slowly while a busy computer slows the simulated cell down."""

    def pause(self, seconds: float) -> None:
        """Let time pass."""

    def state(self) -> MasterState:
        """Returns the state of the brain; an empty one without a brain."""

    def submit(self, action: str, object_id: str) -> TriggerReply:
        """Send a trigger to the brain."""

    def result(self, action: str) -> Exchange | None:
        """Returns the result of this action since the last accepted trigger; None while it runs."""

    def stop(self, reason: str) -> None:
        """STOP: the arm brakes and latches, the brain ends its action."""

    def frame(self, name: str) -> tuple[Pose | None, float]:
        """Returns the newest pose of a frame, and its age (s). None: it was never seen."""

    def show_frame(self, name: str, pose: Pose) -> None:
        """Show an own frame, as goal of a motion, until it is shown elsewhere or the cell is closed."""

    @property
    def frame_delay(self) -> float:
        """s, time until the robot certainly knows a shown frame"""

    def events(self) -> list[Event]:
        """Returns the events since the last call, at most the newest 10 000."""
