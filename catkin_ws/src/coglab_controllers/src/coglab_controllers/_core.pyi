"""Types of the compiled module. Shapes in brackets, units SI, quaternions x y z w, joints in wire order."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
ArrayLike: TypeAlias = npt.ArrayLike

MAX_BASIS: int
"""Largest number of basis functions of a primitive."""

class LibraryError(ValueError):
    """A library file that cannot be used; the text begins with file:line."""

class GoalWeight:
    """Weight w(s) of eq. (1): 0 at the start of a motion, 1 at its end."""

    def __init__(self, kind: str = "linear", centre: float = 0.5, steepness: float = 10.0) -> None:
        """`kind` is linear (w = 1 - s) or sigmoid; `centre` 0..1 and `steepness` 1..100 are of the sigmoid."""
    @property
    def kind(self) -> str: ...
    @property
    def centre(self) -> float: ...
    @property
    def steepness(self) -> float: ...
    def __call__(self, s: float) -> float:
        """w at phase s."""

class Primitive:
    """A learnt motion primitive: everything eq. (1)-(5) need."""

    id: str
    description: str
    duration: float
    """s, of the demonstration: the time constant at ratio 1."""
    alpha: float
    """Rate of the phase, eq. (3)."""
    stiffness: float
    """K of eq. (1), in units of 1/duration^2."""
    damping: float
    """D of eq. (1), in units of 1/duration."""
    goal_weight: GoalWeight
    mapping: str
    """What becomes of the shape for another start and goal: none, similarity or upright."""
    start: Array
    """m (3,), of the demonstration."""
    goal: Array
    """m (3,), of the demonstration."""
    start_velocity: Array
    """m/s (3,), of the demonstration."""
    centres: Array
    """c_i (N,), in phase."""
    widths: Array
    """h_i (N,)."""
    weights: Array
    """w_i, m (N, 3), relative to the start."""

    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises ValueError naming the field that is wrong."""
    def moving_point(self, s: float) -> Array:
        """phi(s) of eq. (5), m (3,), relative to the start."""

class Library:
    """Primitives by id, read from and written to XML."""

    def __init__(self) -> None: ...
    def load(self, path: str) -> int:
        """Adds all primitives of a file, or none; returns how many the file holds. Raises LibraryError."""
    def parse(self, text: str, name: str = "text") -> int:
        """The same from text; `name` stands for the file in messages."""
    def save(self, path: str) -> None:
        """Writes all primitives, exact to the bit. Raises LibraryError."""
    def format(self) -> str:
        """The text that save() writes."""
    def add(self, primitive: Primitive) -> None:
        """Adds or replaces one. Raises ValueError if it is not valid."""
    def ids(self) -> list[str]: ...
    def __getitem__(self, id: str) -> Primitive:
        """Raises KeyError naming the ids that are loaded."""
    def __contains__(self, id: str) -> bool: ...
    def __len__(self) -> int: ...

class Dmp:
    """A running primitive: three axes on one phase, integrated with Runge-Kutta of fourth order."""

    def __init__(
        self,
        primitive: Primitive,
        position: ArrayLike,
        goal: ArrayLike,
        velocity: ArrayLike = ...,
        ratio: float = 1.0,
    ) -> None:
        """Begins at phase 1 from `position` (3,) m with `velocity` (3,) m/s; tau = ratio * duration."""
    def switch_to(self, primitive: Primitive, goal: ArrayLike, ratio: float = 1.0) -> None:
        """Another primitive in mid-motion; phase, position and velocity are kept."""
    def set_ratio(self, ratio: float) -> None:
        """Another time constant; phase, position and velocity are kept."""
    def step(self, dt: float, goal: ArrayLike, goal_velocity: ArrayLike = ..., rate: float = 1.0) -> Array:
        """One cycle of dt s towards g (3,) m moving with g' (3,) m/s; `rate` 0..1 slows the clock. Position (3,)."""
    def roll_out(self, goal: ArrayLike, duration: float, dt: float = 0.005) -> tuple[Array, Array, Array]:
        """Steps to a fixed goal; times (n,), positions (n, 3), velocities (n, 3)."""
    @property
    def position(self) -> Array:
        """m (3,)."""
    @property
    def velocity(self) -> Array:
        """m/s (3,)."""
    @property
    def acceleration(self) -> Array:
        """m/s^2 (3,)."""
    @property
    def phase(self) -> float: ...
    @property
    def progress(self) -> float:
        """Share of the duration that has passed, 0..1."""
    @property
    def tau(self) -> float:
        """s."""
    @property
    def remaining_time(self) -> float:
        """s."""

def learn(
    id: str,
    demonstrations: Sequence[tuple[ArrayLike, ArrayLike]],
    basis_count: int = 20,
    alpha: float = ...,
    stiffness: float = 150.0,
    goal_weight: GoalWeight = ...,
    mapping: str = "none",
    regularisation: float = ...,
    allow: Sequence[str] = (),
) -> Primitive:
    """Learns from one or several demonstrations, each (times (n,) in s, positions (n, 3) in m), by regularised least
    squares on the path. Raises ValueError saying which demonstration or option is wrong. A demonstration that is no
    reach is refused unless ``allow`` names the fault: 'short' (goes less than 0.05 m), 'brief' (takes less than
    0.25 s), 'jump' (faster than 5 m/s between two samples, or one step much longer than those around it), 'moving'
    (faster than half its mean speed at an end), 'noisy' (noise above 2 % of the way it goes)."""

def reproduce(primitive: Primitive, times: ArrayLike, dt: float = 0.001) -> Array:
    """Path (n, 3) in m from the primitive's own start to its own goal, at times (n,) in s."""

class CartesianReference:
    """What a motion asks of the inverse kinematics: the pose now and the mean velocities of the coming cycle."""

    def __init__(
        self,
        position: ArrayLike,
        orientation: ArrayLike,
        velocity: ArrayLike = ...,
        angular_velocity: ArrayLike = ...,
        orientation_control: bool = True,
    ) -> None: ...
    @property
    def position(self) -> Array:
        """m (3,)."""
    @property
    def orientation(self) -> Array:
        """x y z w (4,)."""
    @property
    def velocity(self) -> Array:
        """m/s (3,)."""
    @property
    def angular_velocity(self) -> Array:
        """rad/s (3,), base frame."""
    @property
    def orientation_control(self) -> bool: ...

class CartesianMotion:
    """Goal estimator, DMP, orientation curve and end of motion, in the order of the control cycle."""

    def __init__(self, goal_time_constant: float = 0.06) -> None:
        """`goal_time_constant` of the goal estimator in s; 0 switches it off."""
    def start(
        self,
        primitive: Primitive,
        position: ArrayLike,
        orientation: ArrayLike,
        goal: ArrayLike,
        target: ArrayLike,
        velocity: ArrayLike = ...,
        angular_velocity: ArrayLike = ...,
        ratio: float = 1.0,
        orientation_control: bool = True,
    ) -> None:
        """Begins from a pose towards a goal pose: `goal` (3,) m and `target` (4,) x y z w."""
    def switch_to(
        self,
        primitive: Primitive,
        goal: ArrayLike,
        target: ArrayLike,
        ratio: float = 1.0,
        orientation_control: bool = True,
    ) -> None:
        """Another primitive or ratio in mid-motion; phase, position and velocity are kept."""
    def step(self, dt: float, goal: ArrayLike, target: ArrayLike = ..., rate: float = 1.0) -> CartesianReference:
        """One cycle with the newest goal as received."""
    def stop(self) -> None:
        """Ends the motion where it is."""
    @property
    def phase(self) -> str:
        """idle, running or ended."""
    @property
    def event(self) -> str:
        """Of the last step: ended, follows_again or empty."""
    @property
    def position(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def acceleration(self) -> Array: ...
    @property
    def goal(self) -> Array:
        """Goal as used in eq. (1), m (3,)."""
    @property
    def remaining_distance(self) -> float:
        """From the set-point to the goal as received, m."""
    @property
    def remaining_time(self) -> float:
        """s."""

class GoalFilter:
    """Third-order tracker of a goal with ramp compensation."""

    def __init__(self, time_constant: float = 0.06, max_innovation: float = 0.15) -> None: ...
    def reset(self, goal: ArrayLike) -> None: ...
    def update(self, dt: float, goal: ArrayLike) -> tuple[Array, Array]:
        """g (3,) in m and g' (3,) in m/s after a cycle of dt s."""
    @property
    def position(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...

class GoalLimits:
    """When a goal that moves is no goal any more: it left its region, went back, or fell. All in m, one frame."""

    def __init__(
        self,
        region_low: ArrayLike,
        region_high: ArrayLike,
        retreat: float,
        drop: float,
        hand: ArrayLike,
        goal: ArrayLike,
    ) -> None:
        """Equal corners: anywhere; ``retreat`` and ``drop`` 0: any. ``hand`` and ``goal`` as the motion begins."""
    def update(self, dt: float, goal: ArrayLike) -> tuple[int, str]:
        """(ReasonCode, sentence) after dt s; (0, '') while the motion may go on."""

class OrientationCurve:
    """Quaternion Bezier curve between two orientations."""

    def __init__(
        self, start: ArrayLike, target: ArrayLike, duration: float = 1.0, angular_velocity: ArrayLike = ...
    ) -> None: ...
    def set_target(self, target: ArrayLike) -> None: ...
    def at(self, progress: float) -> Array:
        """Orientation (4,) at progress 0..1."""

class PtpTrajectory:
    """Synchronised, acceleration-limited motion from any position and velocity to rest at a target."""

    def __init__(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        target: ArrayLike,
        max_velocity: ArrayLike,
        max_acceleration: ArrayLike,
        joints: int = 7,
    ) -> None:
        """All arrays (7,): rad, rad/s, rad, rad/s, rad/s^2. Raises ValueError naming joint and field."""
    @property
    def duration(self) -> float:
        """s."""
    @property
    def target(self) -> Array: ...
    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration, each (7,), t seconds after the start."""

class Chain:
    """Kinematic chain of 6 or 7 revolute joints from the text of a URDF."""

    def __init__(self, urdf: str, base_link: str = "lwr_base_link", tip_link: str = "ih2_palm") -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def joint_names(self) -> list[str]: ...
    @property
    def reach(self) -> float:
        """Largest distance from shoulder to wrist, m."""
    def fk(self, q: ArrayLike) -> tuple[Array, Array]:
        """Position (3,) in m and orientation (4,) x y z w of the tip for q (7,) in rad."""
    def jacobian(self, q: ArrayLike) -> Array:
        """(6, 7): rows 0-2 translation, 3-5 rotation, in the base frame."""
    def joint_origins(self, q: ArrayLike) -> Array:
        """(7, 3) in m, a point on each joint's axis."""

class DynamicTerms:
    """Terms of M(q) q'' + C(q, q') q' + g(q) = torque + external torque; links only, without the motors."""

    @property
    def mass(self) -> Array:
        """M (7, 7), kg m^2."""
    @property
    def momentum(self) -> Array:
        """M q' (7,), kg m^2/s."""
    @property
    def coriolis(self) -> Array:
        """C q' (7,), Nm."""
    @property
    def transposed(self) -> Array:
        """C^T q' (7,), Nm: what a momentum observer needs."""
    @property
    def gravity(self) -> Array:
        """g (7,), Nm."""

class ArmDynamics:
    """Rigid-body terms of the arm with its hand (fingers at zero) and a payload, by KDL on the text of a URDF."""

    def __init__(self, urdf: str, base_link: str = "lwr_base_link", tip_link: str = "ih2_palm") -> None:
        """ValueError if the URDF does not parse or has no chain of 7 joints between the links."""
    def set_payload(self, mass: float, centre: ArrayLike = ...) -> None:
        """A point of ``mass`` kg at ``centre`` (3,) m in the frame of the tip; 0 kg: nothing."""
    def evaluate(self, q: ArrayLike, velocity: ArrayLike) -> DynamicTerms:
        """Terms at q (7,) rad and velocity (7,) rad/s."""

class IkResult:
    """One cycle of the inverse kinematics."""

    @property
    def velocity(self) -> Array:
        """rad/s (7,), within the limits."""
    @property
    def position_velocity(self) -> Array:
        """Share of the translation, eq. (9), rad/s (7,)."""
    @property
    def rotation_velocity(self) -> Array:
        """Share of the second task, eq. (11), rad/s (7,)."""
    @property
    def position_error(self) -> Array:
        """m (3,)."""
    @property
    def rotation_error(self) -> Array:
        """rad (3,)."""
    @property
    def smallest_singular_value_position(self) -> float: ...
    @property
    def smallest_singular_value_rotation(self) -> float: ...
    @property
    def second_task_scale(self) -> float:
        """0..1 of the second task that the speed limits left."""
    @property
    def scale(self) -> float:
        """0..1 of the whole vector after that."""
    @property
    def rotation_rejected(self) -> bool:
        """Second task dropped near a singularity."""

class PostureTask:
    """Second task that draws the joints towards a posture (7,) in rad with a gain in 1/s."""

    def __init__(self, posture: ArrayLike, gain: float = 1.0) -> None: ...

class TwoTaskIk:
    """Inverse kinematics with two priorities, eq. (6)-(12)."""

    def __init__(
        self,
        pos_clik_gain: float = 20.0,
        rot_clik_gain: float = 20.0,
        singularity_threshold: float = 0.05,
        stretch_threshold: float = 0.01,
        rotation_first_scaling: bool = True,
        velocity_limit: ArrayLike = ...,
        acceleration_limit: ArrayLike = ...,
        jerk_limit: ArrayLike = ...,
        correction_speed: float = ...,
    ) -> None:
        """Limits (7,) in rad/s, rad/s^2, rad/s^3. With those of acceleration and jerk, errors are answered only by
        speeds from which each joint can brake, and those of the position by correction_speed (m/s) at most."""

    def solve(
        self,
        chain: Chain,
        q: ArrayLike,
        reference: CartesianReference,
        task: PostureTask | None = None,
        velocity: ArrayLike = ...,
        dt: float = 0.0,
    ) -> IkResult:
        """Joint velocities at q (7,); `task` replaces the orientation as second task. With the present joint
        velocity (7,) and the cycle time the Jacobian is that of the middle of the cycle."""

class JointLimits:
    """The robot's table of joint limits; arrays (7,), rad, rad/s, rad/s^2, rad/s^3, Nm."""

    lower_position: Array
    upper_position: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array

    def __init__(self) -> None: ...

def load_joint_limits(path: str, profile: str = "default", own_path: str = "") -> JointLimits:
    """Reads lwr_description/config/joint_limits.yaml. A file that is wider than the robot's own table at ``own_path``
    is refused unless it has the line ``wider_than_robot: true``."""

class Interpolator:
    """Jerk-limited interpolator from target velocities to position commands, as the bridge runs it."""

    def __init__(self, limits: JointLimits) -> None: ...
    def reset(self, position: ArrayLike) -> None: ...
    def step(self, velocity: ArrayLike, dt: float) -> Array:
        """Position command (7,) in rad after dt s towards the target velocity (7,) in rad/s."""
    @property
    def position(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def acceleration(self) -> Array: ...

class WorkspaceParameters:
    """Box (m), sphere around the base (m) and largest stretch (share of the reach)."""

    box_min: Array
    box_max: Array
    base_centre: Array
    base_radius: float
    max_stretch: float

    def __init__(
        self,
        box_min: ArrayLike = ...,
        box_max: ArrayLike = ...,
        base_centre: ArrayLike = ...,
        base_radius: float = 0.25,
        max_stretch: float = 0.98,
    ) -> None: ...

class Workspace:
    """Where the hand may be."""

    def __init__(self, parameters: WorkspaceParameters = ...) -> None: ...
    def contains(self, point: ArrayLike) -> bool: ...
    def violated(self, point: ArrayLike) -> str:
        """Words for the first border that a point (3,) violates."""
    def project(self, point: ArrayLike) -> Array:
        """The nearest allowed point (3,) in m."""

class GuardResult:
    """One cycle of the guard."""

    @property
    def velocity(self) -> Array:
        """rad/s (7,): `scale` times the request."""
    @property
    def scale(self) -> float: ...
    @property
    def joint(self) -> int:
        """Index of the joint that bound, or -1."""
    @property
    def reason(self) -> str: ...
    @property
    def border(self) -> str: ...

class Guard:
    """Scales joint velocities into all limits, keeping their direction."""

    def __init__(
        self,
        chain: Chain,
        limits: JointLimits,
        workspace: WorkspaceParameters = ...,
        hand_speed: float = 1.0,
        elbow_speed: float = 1.0,
        position_margin: float = 0.01,
        reaction_time: float = 0.015,
    ) -> None: ...
    def limit(self, chain: Chain, q: ArrayLike, velocity: ArrayLike) -> GuardResult:
        """One cycle at q (7,) with the requested velocity (7,)."""
    def speed_to_stop(self, joint: int, room: float) -> float:
        """Largest speed in rad/s of a joint `room` rad before its stop."""

class PhaseGovernor:
    """Slows the clock of a motion so that the reference waits for the arm."""

    def __init__(self, rise: float = 2.0, fall: float = 10.0) -> None: ...
    def update(self, dt: float, speed_scale: float, limit_scale: float) -> float:
        """Rate 0..1 for the coming cycle."""
    def reset(self, rate: float = 1.0) -> None: ...
    @property
    def rate(self) -> float: ...

def exp_rotation(rotation_vector: ArrayLike) -> Array:
    """Quaternion (4,) of a rotation vector (3,) in rad."""

def rotation_between(start: ArrayLike, target: ArrayLike) -> Array:
    """Rotation vector (3,) in rad, base frame, from one orientation (4,) to another."""
