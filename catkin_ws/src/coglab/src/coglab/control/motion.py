"""Base class and data of a motion in Python. Plain Python and numpy: no ROS, no C++.

The same class moves the arm of `coglab.World`, within its control cycle, and that of the running robot
(`./coglab controller run FILE`). Joint arrays have shape (7,) in wire order. Poses and twists are those of the palm in
the frame of the robot's base. Times and velocities count motion time, which runs slower than the clock while a limit or
`speed_scale` slows the arm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

JOINTS = 7
MOST_ARGUMENTS = 16  # limit of a request to the robot's controller manager


class ControlError(ValueError):
    """A motion, a controller, or its returned value is invalid. The message has the expected and the actual value."""


@dataclass(frozen=True)
class Argument:
    """One number that a request for the motion may carry."""

    name: str
    unit: str
    default: float
    low: float  # smallest and largest value; a request outside is refused
    high: float


@dataclass(frozen=True)
class SetPoint:
    """State of the set-point when the motion starts. The first reference must continue it."""

    joints: Vector  # rad, (7,)
    joint_velocity: Vector  # rad/s, (7,)
    position: Vector  # m, (3,)
    orientation: Vector  # quaternion x y z w, (4,)
    twist: Vector  # m/s and rad/s, (6,)


@dataclass(frozen=True)
class MotionStart:
    """Input of `Motion.start()`."""

    arguments: Mapping[str, float]  # every declared argument with its value
    set_point: SetPoint


@dataclass(frozen=True)
class MotionCycle:
    """Input of `Motion.reference()`."""

    time: float  # s of motion time since the start
    next: float  # s of motion time, that of the next cycle
    joints: Vector  # measured, rad, (7,)


class MotionSetup:
    """Input of `Motion.configure()`: the robot, and the place to declare arguments."""

    def __init__(self, robot: Any = None, cycle_time: float = 0.005) -> None:
        """`robot`: an object with `chain` and `limits` of the arm (`None` without a robot); `cycle_time`: s."""
        self.robot = robot
        self.cycle_time = cycle_time
        self._arguments: dict[str, Argument] = {}

    @property
    def arguments(self) -> tuple[Argument, ...]:
        """The declared arguments, in the order of declaration."""
        return tuple(self._arguments.values())

    def argument(self, name: str, unit: str, default: float, low: float, high: float) -> str:
        """Declare a number that a request may carry, and return its name.

        Raises ControlError if the name is no identifier or is declared twice, if a number is not finite, if the
        default is outside of low..high, or after 16 arguments.
        """
        if not isinstance(name, str) or not name.isidentifier():
            raise ControlError(f"argument {name!r}: a name of letters, digits and _ is expected")
        if name in self._arguments:
            raise ControlError(f"argument {name!r} is declared twice; give the second one another name")
        if len(self._arguments) == MOST_ARGUMENTS:
            raise ControlError(f"a motion has at most {MOST_ARGUMENTS} arguments; {name!r} is one more")
        numbers = {"default": default, "low": low, "high": high}
        for what, value in numbers.items():
            if not isinstance(value, int | float) or not math.isfinite(value):
                raise ControlError(f"argument {name!r}: {what} is {value!r}, a finite number is expected")
        if not low <= default <= high:
            raise ControlError(f"argument {name!r}: the default {default} {unit} is outside of {low} to {high}")
        self._arguments[name] = Argument(name, unit, float(default), float(low), float(high))
        return name

    def values(self, given: Mapping[str, float]) -> dict[str, float]:
        """Returns the value of every argument: the given one, else its default.

        Raises ControlError for an unknown name, a value that is no number, or a value outside of its range.
        """
        unknown = sorted(set(given) - set(self._arguments))
        if unknown:
            known = ", ".join(self._arguments) or "none"
            raise ControlError(f"the motion has no argument {unknown[0]!r}; it has: {known}")
        values = {name: argument.default for name, argument in self._arguments.items()}
        for name, value in given.items():
            argument = self._arguments[name]
            if not isinstance(value, int | float) or not argument.low <= value <= argument.high:
                raise ControlError(
                    f"argument {name!r}: {argument.low} to {argument.high} {argument.unit} is expected, {value!r} came"
                )
            values[name] = float(value)
        return values


def _numbers(name: str, value: npt.ArrayLike, size: int) -> Vector:
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")
        array = np.array(value, dtype=np.float64)  # a copy, so that the caller may reuse the array
    except (TypeError, ValueError) as error:
        raise ControlError(f"{name}: {size} numbers are expected, {value!r} came") from error
    if array.shape != (size,):
        raise ControlError(f"{name}: shape ({size},) is expected, shape {array.shape} came")
    wrong = np.flatnonzero(~np.isfinite(array))
    if wrong.size:
        raise ControlError(f"{name}: finite numbers are expected, {name}[{wrong[0]}] is {array[wrong[0]]}")
    return array


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of the arm for this cycle: joints with their velocity, a pose of the palm with its twist, or rest.

    `Reference(joints=q, joint_velocity=v)`, `Reference(position=p, orientation=o, twist=t)` or `Reference()`: the arm
    brakes and stands. A velocity that is left out is zero. Raises ControlError for wrong shapes, for numbers that are
    not finite, for a quaternion that is not of length 1 (within 1e-3) and for joints beside a pose.
    """

    joints: Vector | None = None  # rad, (7,)
    joint_velocity: Vector | None = None  # rad per second of motion time, (7,)
    position: Vector | None = None  # m, (3,)
    orientation: Vector | None = None  # quaternion x y z w, (4,)
    twist: Vector | None = None  # m and rad per second of motion time, (6,)
    at_rest: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        """Check the fields and copy them into arrays of float64."""
        put = object.__setattr__
        in_joints = self.joints is not None or self.joint_velocity is not None
        in_space = any(value is not None for value in (self.position, self.orientation, self.twist))
        if in_joints and in_space:
            raise ControlError("a reference has joints or a pose of the palm; both came")
        if in_joints:
            if self.joints is None:
                raise ControlError("joint_velocity came without joints; give both")
            put(self, "joints", _numbers("joints", self.joints, JOINTS))
            velocity = np.zeros(JOINTS) if self.joint_velocity is None else self.joint_velocity
            put(self, "joint_velocity", _numbers("joint_velocity", velocity, JOINTS))
        elif in_space:
            if self.position is None or self.orientation is None:
                raise ControlError("a pose needs position and orientation; one of them is missing")
            put(self, "position", _numbers("position", self.position, 3))
            orientation = _numbers("orientation", self.orientation, 4)
            length = float(np.linalg.norm(orientation))
            if abs(length - 1.0) > 1e-3:
                raise ControlError(f"orientation: a quaternion of length 1 is expected, its length is {length:.4g}")
            put(self, "orientation", orientation / length)
            put(self, "twist", _numbers("twist", np.zeros(6) if self.twist is None else self.twist, 6))
        else:
            put(self, "at_rest", True)


class Motion:
    """A motion of the arm, from its start to its end. Derive from it and override `start`, `reference` and `done`.

    A class need not derive from it: it is enough to have the four methods. An exception in one of them ends the motion,
    and the arm brakes.
    """

    def configure(self, setup: MotionSetup) -> None:
        """Declare arguments by `setup.argument()`. Called once, before the first start."""

    def start(self, start: MotionStart) -> None:
        """Begin a motion at `start.set_point`."""
        raise NotImplementedError(f"{type(self).__name__} has no start()")

    def reference(self, cycle: MotionCycle) -> Reference:
        """Return the reference for `cycle.time`. Called once a cycle while the motion runs."""
        raise NotImplementedError(f"{type(self).__name__} has no reference()")

    def done(self) -> bool:
        """Return true when the reference has ended. Called after each `reference()`."""
        raise NotImplementedError(f"{type(self).__name__} has no done()")


def is_done(motion: Any) -> bool:
    """Returns whether a motion has ended. ControlError if its done() returns no truth value."""
    value = motion.done()
    if not isinstance(value, (bool, np.bool_)):
        raise ControlError(f"done() returned {value!r}; True or False is expected")
    return bool(value)
