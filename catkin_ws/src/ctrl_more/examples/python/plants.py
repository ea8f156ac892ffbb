"""Three small robots to try feedback controllers on: a fixed arm, a biped and a wheeled base.

Each plant needs only numpy. `step()` moves it by one cycle. Its properties have the sizes and units
that the controllers of this package declare for their signals, so a program copies them into
`RobotStates` unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2


class FixedArm:
    """A planar arm of three rotary joints, driven by joint velocities, beside a soft wall.

    The arm moves in the plane z = 0 of its base frame. The drives follow a velocity with a lag of
    first order. The wall is a spring at `wall_x` that pushes the tip back toward smaller x.
    """

    def __init__(
        self,
        joints: Sequence[float],
        links: Sequence[float] = (0.4, 0.35, 0.2),
        lag: float = 0.02,
        wall_x: float = math.inf,
        wall_stiffness: float = 2000.0,
    ) -> None:
        """Place the arm at rest.

        joints: positions [3] in rad. links: lengths [3] in m. lag: time constant of the drives in s.
        wall_x: place of the wall in m, infinite for none. wall_stiffness: in N/m.
        """
        self.joints: Vector = _numbers("joints", joints, 3)
        self.links: Vector = _positive("links", _numbers("links", links, 3))
        self.lag = float(_positive("lag", np.array([lag]))[0])
        self.wall_x = wall_x
        self.wall_stiffness = wall_stiffness
        self.joint_velocity: Vector = np.zeros(3)

    @property
    def pose(self) -> Vector:
        """Position [3] in m and quaternion x y z w [4] of the tip in the base frame."""
        # The angle of each link in the base frame is the sum of the joints before it.
        angles = np.cumsum(self.joints)
        x = float(self.links @ np.cos(angles))
        y = float(self.links @ np.sin(angles))
        half = 0.5 * angles[-1]
        return np.array([x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half)])

    @property
    def jacobian(self) -> Vector:
        """Tip velocity (x, y in m/s and the turn about z in rad/s) per joint velocity, [3, 3]."""
        angles = np.cumsum(self.joints)
        along_x = self.links * np.cos(angles)
        along_y = self.links * np.sin(angles)
        # A joint moves all the links behind it.
        return np.array(
            [
                [-along_y[i:].sum() for i in range(3)],
                [along_x[i:].sum() for i in range(3)],
                [1.0, 1.0, 1.0],
            ]
        )

    @property
    def wrench(self) -> Vector:
        """Force [3] in N and torque [3] in Nm of the wall on the tip, base frame."""
        depth = max(0.0, float(self.pose[0]) - self.wall_x)
        return np.array([-self.wall_stiffness * depth, 0.0, 0.0, 0.0, 0.0, 0.0])

    def step(self, joint_velocity: npt.ArrayLike, dt: float) -> None:
        """Follow `joint_velocity` [3] in rad/s for `dt` s."""
        wanted = _numbers("joint_velocity", joint_velocity, 3)
        # Exact for a command that is held: q'' = (u - q') / lag.
        share = -math.expm1(-dt / self.lag)
        self.joints = self.joints + wanted * dt + (self.joint_velocity - wanted) * self.lag * share
        self.joint_velocity = self.joint_velocity + share * (wanted - self.joint_velocity)


class Biped:
    """A standing biped as a linear inverted pendulum of constant height.

    Kajita et al., "The 3D linear inverted pendulum mode", IROS 2001: c'' = w^2 (c - p) + F / m with
    w = sqrt(g / h), centre of mass c, ZMP p and horizontal push F. The ZMP cannot leave the feet.
    """

    def __init__(
        self,
        mass: float = 40.0,
        height: float = 0.8,
        half_foot: Sequence[float] = (0.1, 0.06),
        reach: float = 0.3,
    ) -> None:
        """Stand still over the origin.

        mass: kg. height: of the centre of mass, m. half_foot: half length and half width of the
        support box in m. reach: distance of the centre of mass at which the robot has fallen, m.
        """
        self.mass = float(_positive("mass", np.array([mass]))[0])
        self.height = float(_positive("height", np.array([height]))[0])
        self.half_foot: Vector = _positive("half_foot", _numbers("half_foot", half_foot, 2))
        self.reach = float(_positive("reach", np.array([reach]))[0])
        self.omega = math.sqrt(GRAVITY / self.height)  # 1/s
        self.position: Vector = np.zeros(2)  # m
        self.velocity: Vector = np.zeros(2)  # m/s
        self.fallen = False
        self._zmp: Vector = np.zeros(2)

    @property
    def com(self) -> Vector:
        """Position [3] in m and velocity [3] in m/s of the centre of mass, world frame."""
        return np.concatenate([self.position, [self.height], self.velocity, [0.0]])

    @property
    def zmp(self) -> Vector:
        """The ZMP [3] of the last cycle in m, world frame."""
        return np.append(self._zmp, 0.0)

    @property
    def dcm(self) -> Vector:
        """Divergent component of motion c + c' / w [2] in m."""
        return self.position + self.velocity / self.omega

    def step(self, zmp: npt.ArrayLike, push: npt.ArrayLike, dt: float) -> None:
        """Stand on `zmp` ([2] or [3], m) under a horizontal `push` [2] in N for `dt` s."""
        wanted = np.asarray(zmp, dtype=float)[:2]
        self._zmp = np.clip(_numbers("zmp", wanted, 2), -self.half_foot, self.half_foot)
        if self.fallen:
            return
        # A push acts like a ZMP that lies further back. For both held over the cycle this is exact.
        about = self._zmp - _numbers("push", push, 2) / (self.mass * self.omega**2)
        cosh, sinh = math.cosh(self.omega * dt), math.sinh(self.omega * dt)
        away = self.position - about
        self.position = about + cosh * away + sinh / self.omega * self.velocity
        self.velocity = self.omega * sinh * away + cosh * self.velocity
        self.fallen = bool(np.linalg.norm(self.position) > self.reach)


class WheeledBase:
    """A base with two driven wheels that may slip (the unicycle model, without sideways motion)."""

    def __init__(
        self,
        pose: Sequence[float] = (0.0, 0.0, 0.0),
        track: float = 0.4,
        slip: Sequence[float] = (0.0, 0.0),
    ) -> None:
        """Place the base at rest.

        pose: x, y in m and heading in rad, world frame. track: distance of the wheels in m.
        slip: share of the speed that the left and the right wheel lose, 0 to below 1.
        """
        self.pose: Vector = _numbers("pose", pose, 3)
        self.track = float(_positive("track", np.array([track]))[0])
        self.slip: Vector = _numbers("slip", slip, 2)
        if np.any(self.slip < 0.0) or np.any(self.slip >= 1.0):
            raise ValueError(f"slip: expected two shares from 0 to below 1, got {list(slip)}")
        self.twist: Vector = np.zeros(2)

    def step(self, twist: npt.ArrayLike, dt: float) -> None:
        """Drive `twist` (forward m/s, turn rad/s) for `dt` s. `self.twist` is what the slip left."""
        forward, turn = _numbers("twist", twist, 2)
        wheels = forward + 0.5 * self.track * turn * np.array([-1.0, 1.0])  # m/s, left and right
        left, right = (1.0 - self.slip) * wheels
        speed, rate = 0.5 * (left + right), (right - left) / self.track
        x, y, heading = self.pose
        # Exact for a held twist: an arc has the chord v dt sinc(a) in the direction of its middle.
        half = 0.5 * rate * dt
        chord = speed * dt * float(np.sinc(half / math.pi))
        self.pose = np.array(
            [
                x + chord * math.cos(heading + half),
                y + chord * math.sin(heading + half),
                heading + rate * dt,
            ]
        )
        self.twist = np.array([speed, rate])


def _numbers(name: str, values: npt.ArrayLike, size: int) -> Vector:
    """Copy `values` as `size` finite numbers, or refuse them in words."""
    numbers = np.array(values, dtype=float)
    if numbers.shape != (size,) or not np.all(np.isfinite(numbers)):
        raise ValueError(f"{name}: expected {size} finite numbers, got {values!r}")
    return numbers


def _positive(name: str, values: Vector) -> Vector:
    """Return `values` if all are finite and above 0, or refuse them in words."""
    if not np.all(np.isfinite(values) & (values > 0.0)):
        raise ValueError(f"{name}: expected numbers above 0, got {values.tolist()}")
    return values
