"""What the machines need from the rest of the system, as interfaces without ROS.

Adapters: the package ``ros`` (services, actions and topics) and the package ``simulated`` (virtual time, for tests and
benches).
Methods that return a Pending may take time; the states wait on it within their limits. All others return at once.
Units are SI; joints in wire order lwr_a1 lwr_a2 lwr_e1 lwr_a3 lwr_a4 lwr_a5 lwr_a6; quaternions x y z w.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from coglab_contact.evidence import ContactEvent

from coglab_smach.kinematics.motion_time import MotionLimits
from coglab_smach.ports.pending import Pending


class Verdict(NamedTuple):
    """Yes or no, and if not, why: in words and as a number of coglab_msgs/ReasonCode."""

    ok: bool
    why: str = ""
    code: int = 0


@dataclass(frozen=True)
class DmpRequest:
    """One execute_dmp or switch_dmp (D4.10 Table 4), from the current state; the fields are those of the services.
    Positions (m) and orientation (quaternion; all zero: the present one) are relative to ``goal_frame``, which
    switch_dmp leaves as it is."""

    primitive_id: str
    goal_frame: str
    goal_offset: Sequence[float]
    dmp_ratio: float = 1.0
    orientation_control: bool = False
    target_orientation: Sequence[float] = (0.0, 0.0, 0.0, 0.0)
    goal_approach: Sequence[float] = (0.0, 0.0, 0.0)
    arrival_speed: float = 0.0
    goal_region_low: Sequence[float] = (0.0, 0.0, 0.0)
    goal_region_high: Sequence[float] = (0.0, 0.0, 0.0)
    goal_retreat: float = 0.0
    goal_drop: float = 0.0


@dataclass(frozen=True)
class DmpProgress:
    """How the running DMP motion stands: state is idle, running, reached, holding or aborted; ``code`` (ReasonCode) is
    that of the reason. Nothing has been heard of a motion yet while ``primitive_id`` is empty."""

    state: str = "idle"
    reason: str = ""
    primitive_id: str = ""
    phase: float = 0.0
    remaining_distance: float = 0.0
    code: int = 0
    remaining_time: float = 0.0
    """s, by the primitive's own clock: what dmp_ratio asks for, whatever the limits make of it"""


@dataclass(frozen=True)
class Located:
    """Where an object is: its tf2 frame, its pose in ``parent`` (xyz m, quaternion) and the age of that pose (s)."""

    frame: str
    parent: str
    xyz: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    age: float


@dataclass(frozen=True)
class HandState:
    """What the machines need of hand_status; positions of five motors 0 open .. 254 closed, empty if unknown."""

    connected: bool = False
    calibrated: bool = False
    calibrating: bool = False
    holding: bool = False
    message: str = ""
    positions: tuple[int, ...] = ()
    event: int = 0
    """ReasonCode of the message"""


@dataclass(frozen=True)
class Recognition:
    """Motion recognition of the partner: class name ('unknown' if none), its confidence 0..1 and whether it
    is settled."""

    pattern: str = "unknown"
    confidence: float = 0.0
    decided: bool = False
    scores: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Ahead:
    """What the partner is believed to be about: probability that an object is offered or the robot's is asked for, and
    where that will be. ``frame``: tf2 frame of the place, with its position in the base frame (m) and its standard
    deviation (m); empty while no place is predicted."""

    offer: float = 0.0
    request: float = 0.0
    object_id: str = ""
    frame: str = ""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    deviation: float = 0.0


class ArmPort(Protocol):
    """The low-level cognitive controller and the LWR interface behind it."""

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        """Load a controller plug-in; value: None. Loading what is already loaded with that type succeeds."""

    def load_dmps(self, filename: str) -> Pending:
        """Load a library of primitives; value: how many."""

    def lwr_command(self, event: str) -> Pending:
        """Acknowledged command to the LWR interface (start, hold, reset, stop, position ...); value: outcome
        in words."""

    def motion_allowed(self) -> Verdict:
        """Whether target velocities are followed now, and why not."""

    def standing(self) -> Verdict:
        """Whether the set-point of the arm stands (velocity and acceleration zero), and why not, or why that is not
        known."""

    def cancel_motion(self, reason: str) -> Pending:
        """End every motion that runs or waits; the arm brakes within its limits. Value: None, once the set-point
        stands. With nothing to end it succeeds too. This request alone is never withdrawn: giving up waiting for it
        leaves it in force."""

    def motion_limits(self) -> MotionLimits:
        """What bounds the arm's speed; the reduced limits where a reduced profile is in force."""

    def speed_scale(self) -> float:
        """Share of its planned speed at which the reference runs now, 0..1."""

    def switch_controller(self, controller_id: str) -> Pending:
        """Make a plug-in the active one; ends the motion of the other. Value: its type."""

    def apply_profile(self, profile: str) -> Pending:
        """Enable exactly the feedback controllers of a named profile, at one cycle boundary; value: None."""

    def profile_settled(self, profile: str) -> Verdict:
        """Whether this profile is in force and nothing of the one before it is left: the last correction of each
        feedback controller that it does not enable has faded. If not, why."""

    def execute_dmp(self, request: DmpRequest) -> Pending:
        """Start a DMP motion; value: None once it is accepted. The motion goes on until it is cancelled, replaced by
        another one or ended by a switch: also when nobody waits. cancel() ends it."""

    def switch_dmp(self, request: DmpRequest) -> Pending:
        """Substitute the running primitive; phase, position and velocity are kept. Value: None."""

    def dmp_progress(self) -> DmpProgress:
        """The newest progress since the last accepted execute_dmp."""

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        """Point-to-point motion (rad, rad/s); value: None when it has been executed to its end. PortError with the
        reason where it ended before. The motion goes on when nobody waits; cancel() ends it."""

    def joint_positions(self) -> tuple[float, ...] | None:
        """Measured joints (rad), None if unknown or older than 0.5 s."""

    def hold(self, reason: str) -> Pending:
        """Brake and latch. Never touches the hand."""


class HandPort(Protocol):
    """The IH2 hand."""

    def calibrate(self, mode: str) -> Pending:
        """Calibrate (fast, complete, each also with ' force'); value: None when it has ended."""

    def preshape(self, mode: str, level: str) -> Pending:
        """Take the preshape of a grasp mode; value: None."""

    def close_on_object(self) -> Pending:
        """Close the preshaped hand; value: None when it has closed or stalled on an object."""

    def close(self, speed: int) -> Pending:
        """Close the fingers from where they are, at a wire speed 1..511 and with the force that goes with it; value:
        None when they stand."""

    def open(self, speed: int) -> Pending:
        """Open at a wire speed 1..511; value: None. Cancelled, the fingers stand where they are."""

    def state(self) -> HandState:
        """The newest status; connected=False if the node is silent for more than 1 s."""


OLDEST_BELIEF, OLDEST_RECOGNITION = 0.3, 0.5
"""s after which nothing is known any more of a hand that is not seen"""


class PerceptionPort(Protocol):
    """The perception modules, whoever provides them."""

    def init_vision(self, time_limit: float) -> Pending:
        """Start the modules; value: message in words."""

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        """Where an object (or 'human_hand') is now; value: Located."""

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        """Free places on the board; value: list of Located in frame 'board', best first."""

    def recognition(self) -> Recognition:
        """The newest recognition of the partner's motion; nothing is recognised where none has come for 0.5 s."""

    def ahead(self) -> Ahead:
        """The newest belief about an offer or a request; nothing is believed where none has come for 0.3 s."""


class DatabasePort(Protocol):
    """The object database."""

    def get_object(self, object_id: str) -> Pending:
        """One entry; value: dict valid against the object schema."""

    def list_objects(self) -> Pending:
        """Ids of all objects; value: list of str."""


class ContactPort(Protocol):
    """The contact trigger. wait_stop depends on this alone, so a tactile hand can stand behind it."""

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        """Forget old events and watch for 'contact' (an object touches the hand of an arm that stands),
        'contact_in_motion' (moving or not), 'load' (its weight is carried now), 'lift' (likewise, counted from now on,
        while the arm lifts) or 'release' (its weight is leaving); value: None once accepted. ``settings``: fields of
        the service ArmContact."""

    def disarm(self) -> None:
        """Stop watching."""

    def event(self) -> ContactEvent | None:
        """The first event since arm(), None until then."""

    def share_gone(self) -> float | None:
        """Share of the object's weight that has left the hand since it was armed for 'release', as far as that is
        sure, also after its event: 0 none, 1 all, more where the hand is lifted. None while nobody watches."""

    def force(self) -> tuple[float, float, float] | None:
        """N on the palm, base frame, beyond what acted before the last reach in which 'contact_in_motion' was watched
        for, whether somebody watches now or not. What an object weighs is a part of it until the detector has been told
        that it is carried. None where it is not known, or older than 0.1 s."""

    def grip(self) -> float | None:
        """N with which the fingers squeeze what they hold; None where nothing in the hand tells that."""
