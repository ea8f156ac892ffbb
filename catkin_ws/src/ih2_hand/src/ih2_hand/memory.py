"""State of a hand between requests (calibration, preshape, grip), and the goals it accepts in that state. No ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ih2_hand import grasps
from ih2_hand.driver import HandSerialDriver
from ih2_hand.errors import HandCalibratingError, RefusedError
from ih2_hand.progress import (
    CloseTask,
    GraspTask,
    MotorVerdict,
    OpenTask,
    PreshapeTask,
    Task,
    refuse_calibration,
    shown_empty,
    shown_holding,
)
from ih2_hand.reasons import Reason


class HandMemory:
    """Calibration, preshape and grip of one hand. A hand that has just been connected may hold an object.

    `is_current` True closes by motor current, False by tension. `limit` (s) is the time limit of preshape and grasp.
    """

    def __init__(self, is_current: bool, limit: float) -> None:
        self.calibrating = False
        self._is_current, self._limit = is_current, limit
        self.forget()

    def forget(self) -> None:
        """Reset the state: the hand was reconnected or lost."""
        self.calibrated, self.holding = False, True
        self._preshape: tuple[str, str] | None = None

    def task_for(self, name: str, goal: Any, driver: HandSerialDriver) -> Task:
        """Task for a goal with the fields of its action. RefusedError or HandError give the reason to refuse it."""
        if self.calibrating:
            raise HandCalibratingError("the hand calibrates; send the goal again afterwards")
        if name == "hand_open":
            task: Task = OpenTask(goal.speed)
        elif name == "hand_close":
            task = CloseTask(goal.speed)
        elif name == "hand_preshape":
            grasps.check_grasp(goal.mode, goal.level, driver.dialect)
            task = PreshapeTask(goal.mode, goal.level, self._is_current, self._limit)
        else:
            if self._preshape is None:
                raise RefusedError(
                    "the hand is not preshaped: call hand_preshape first (hand_open, "
                    "hand_close, calibration or reconnection undo it)",
                    Reason.HAND_REFUSED,
                )
            task = GraspTask(grasps.CLOSING_MOTORS[self._preshape[0]], self._limit)
        if name != "hand_preshape_close":
            self._preshape = None
        return task

    def task_over(self, task: Task, verdict: MotorVerdict) -> None:
        """Update preshape and grip after a finished task."""
        if isinstance(task, PreshapeTask) and verdict.ok:
            self._preshape = (task.mode, task.level)
        if verdict.holding is not None:
            self.holding = verdict.holding
        elif isinstance(task, (CloseTask, GraspTask)) and not verdict.ok:
            self.holding = True  # interrupted: an object may be between the fingers

    def look(self, motors: Sequence[Any]) -> bool:
        """Update the grip from a poll of the motors. True if it is the first to show an empty hand."""
        if self.holding and shown_empty(motors):
            self.holding = False
            return True
        self.holding = self.holding or shown_holding(motors)
        return False

    def why_not_calibrate(self, words: Sequence[str], busy: str | None) -> str | None:
        """Reason to refuse a calibration request, or None. `busy` names the running goal."""
        busy = f"{busy} runs" if busy else "a calibration runs" if self.calibrating else None
        return refuse_calibration(words, calibrated=self.calibrated, holding=self.holding, busy=busy)

    def calibration_began(self) -> None:
        """Record the start of a calibration: the hand opens and discards every request until the end."""
        self.calibrating, self.calibrated, self._preshape = True, False, None
