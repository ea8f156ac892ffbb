"""Runs a feedback controller of ctrl_more for the robot's control cycle, in its own process.

The controller runs in a `ctrl_more.FeedbackControllersManager`, as in the robot: with the same checks of its
description, the same gains, and the same removal of invalid corrections. The slot transmits copies of the robot's
states, and returns one correction, a shift and a turn of the hand's reference.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from ctrl_more import (
    ControlStates,
    Cycle,
    FeedbackController,
    FeedbackControllersManager,
    Logger,
    LogRecord,
    Refused,
    RobotStates,
)

from coglab.control import slot as wire
from coglab.control.motion import JOINTS, ControlError, Vector

GAP = 0.1  # s without a question, after which the controller resets its internal state
WIRE = "joints in wire order"
# States in a slot: key, size, unit, frame, field of the question. The robot's own stores have the same.
MEASURED = (
    ("joint_position", 7, "rad", WIRE, "joints"),
    ("joint_velocity", 7, "rad/s", WIRE, "joint_velocity"),
    ("joint_torque", 7, "Nm", WIRE, "joint_torque"),
    ("external_torque", 7, "Nm", WIRE, "external_torque"),
    ("wrench", 6, "N, Nm", "base", "wrench"),
)
POSE, TWIST = "taskSpaceReferencePose", "taskSpaceReferenceVel"
CARRIED_STATES = {f"measuredData/{key}" for key, *_ in MEASURED} | {"estimatedData/ee"}
CARRIED_REFERENCES = {f"{POSE}/ee", f"{TWIST}/ee"}
CARRIED = (
    "A slot carries measuredData/joint_position, joint_velocity, joint_torque, external_torque (7 numbers each) and "
    f"wrench (6), estimatedData/ee (7), and the references {POSE}/ee (7) and {TWIST}/ee (6). It takes back a shift and "
    f"a turn of {POSE}/ee, and computes their velocity itself. A controller that needs more runs in coglab.World, or "
    "in C++ in the robot."
)


def turned(after: Vector, before: Vector) -> tuple[float, float, float]:
    """Rotation vector (rad, base frame) from the quaternion `before` to `after`, both x y z w, (4,)."""
    ax, ay, az, aw = after.tolist()
    bx, by, bz, bw = before.tolist()
    x = ax * bw - aw * bx - ay * bz + az * by
    y = ay * bw - aw * by - az * bx + ax * bz
    z = az * bw - aw * bz - ax * by + ay * bx
    w = aw * bw + ax * bx + ay * by + az * bz
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        return 0.0, 0.0, 0.0
    factor = 2.0 * math.atan2(math.copysign(length, w), abs(w)) / length
    return factor * x, factor * y, factor * z


class FeedbackHost:
    """One feedback controller with the states that it reads and the references that it corrects."""

    def __init__(
        self,
        controller: FeedbackController,
        gains: Mapping[str, float | list[float]],
        *,
        config: Path | None = None,
        period: float = 0.005,
    ) -> None:
        """`gains`: replace those of the description or of the file `config`; `period`: intended cycle time, s.

        Raises ControlError if the controller needs a state that a slot does not carry, if its description is refused,
        or for invalid gains.
        """
        self.controller, self.name = controller, type(controller).__name__
        self._log = Logger()
        self._log.add_sink(self._show)
        self._robot, self._control = RobotStates(self._log), ControlStates(JOINTS, period, self._log)
        for key, size, unit, frame, _ in MEASURED:
            self._robot.declare("measuredData", key, size, unit, frame)
        self._robot.declare("estimatedData", "ee", 7, "m, quaternion x y z w", "base")
        self._control.declare(POSE, "ee", 7, "m, quaternion x y z w", "base")
        self._control.declare(TWIST, "ee", 6, "m/s, rad/s", "base")
        # No blending and no limit of time here: the slot bounds the rate, and lets late corrections fade.
        self.manager = FeedbackControllersManager(
            self._robot, self._control, blend_s=0.0, lockstep=True, logger=self._log
        )
        try:
            self.manager.add_controller(controller, self.name, enabled=True, config_file=config)
            self._judge()
            self.set(gains)
            self.manager.freeze()
        except Refused as error:
            raise ControlError(str(error)) from error
        self._pose, self._twist = self._control.view(POSE, "ee"), self._control.view(TWIST, "ee")
        self._run = self._stamp = self._number = self._faults = 0
        self._failed = False

    def _judge(self) -> None:
        """Refuse a controller that needs more than a slot carries."""
        name, description = self.name, self.manager.describe(self.name)
        if description.stage != "task":
            raise ControlError(f"{name} acts in the {description.stage} stage, a slot in the task stage. {CARRIED}")
        used = [*self.manager.get_used_robot_states(), *self.manager.get_used_control_states()]
        more = [signal for signal in used if signal not in CARRIED_STATES | CARRIED_REFERENCES]
        if more:
            raise ControlError(f"{name} needs {', '.join(more)}, which a slot does not carry. {CARRIED}")
        if not any(use.modifies and use.container == POSE for use in description.control_signals):
            raise ControlError(f"{name} does not modify {POSE}/ee, so it would do nothing here. {CARRIED}")

    def set(self, gains: Mapping[str, float | list[float]]) -> None:
        """Set gains, all or none, from the next question on. Raises ControlError."""
        if not gains:
            return
        try:
            self.manager.set_gains(self.name, gains)
        except Refused as error:
            raise ControlError(str(error)) from error

    def answer(self, question: np.void, answer: npt.NDArray[np.void]) -> bool:
        """Fill in the answer to a question. Return false if there is nothing to answer.

        A fault of the controller is printed, and the robot lets the correction fade. The next time that the robot
        enables the slot, the controller gets another try.
        """
        run, stamp = int(question["run"]), int(question["stamp_ns"])
        dt = 1e-9 * (stamp - self._stamp)
        if run != self._run:
            self._failed = False
        elif self._failed:
            return False
        answer["stamp_ns"], answer["run"], answer["time"] = stamp, run, question["time"]
        answer["done"], answer["kind"], answer["values"] = 0, wire.CORRECTION, 0.0
        if run != self._run or not 0.0 < dt < GAP:
            dt = float(question["dt"])
            self._begin(run)
        self._stamp = stamp
        self._number += 1
        for key, _, _, _, field in MEASURED:
            self._robot.set_measured_data(key, question[field], stamp)
        self._robot.set_estimated_data("ee", question["hand"], stamp)
        before: Vector = question["reference_pose"]
        self._pose[:], self._twist[:] = before, question["reference_twist"]
        self.manager.update(Cycle(stamp, dt, self._number))
        self._log.drain()
        status = self.manager.status(self.name)
        if status.faults > self._faults:
            self._faults = status.faults
            self._fail(status.fault_text or status.fault)
        if self._failed:
            answer["kind"] = wire.GIVE_UP
            return True
        values: Any = answer["values"][0]
        values[:3] = self._pose[:3] - before[:3]
        values[3:6] = turned(self._pose[3:], before[3:])
        return True

    def _show(self, record: LogRecord) -> None:
        """Print the controller's log records. `_fail` prints the important ones of the library."""
        if record.source == self.name and not record.file:
            print(f"{record.source}: {record.level}: {record.message}", flush=True)

    def _begin(self, run: int) -> None:
        """Restart the controller: the robot has enabled the slot, or this process was suspended."""
        self._run = run
        if self.manager.status(self.name).paused:
            self.manager.resume(self.name, "fault")
        try:
            self.controller.reset()
        except Exception as error:
            self._fail(f"reset(): {type(error).__name__}: {error}")

    def _fail(self, text: str) -> None:
        self._failed = True
        print(
            f"{self.name} is at fault and its correction fades: {text}\nCorrect the file and run "
            "it again, or disable and enable the slot in the robot for another try.",
            file=sys.stderr,
            flush=True,
        )
