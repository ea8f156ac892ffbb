"""Interfaces of the state machines to the rest of the system, independent of ROS.

Adapters: the package ``ros`` (services, actions and topics) and ``coglab_trials`` (virtual time, for tests and
benches).
Methods that return a Pending may take time; the states wait for it with a time limit. All others return at once.
SI units; joints in wire order lwr_a1 lwr_a2 lwr_e1 lwr_a3 lwr_a4 lwr_a5 lwr_a6; quaternions x y z w.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from coglab_contact.evidence import ContactEvent

from coglab_smach.kinematics.motion_time import MotionLimits
from coglab_smach.ports.pending import Pending


class Verdict(NamedTuple):
    """Yes or no. If no: the reason as a sentence and as a coglab_msgs/ReasonCode."""

    ok: bool
    why: str = ""
    code: int = 0


@dataclass(frozen=True)
class DmpRequest:
    """Request of execute_dmp or switch_dmp (D4.10 Table 4), from the current state. The fields are those of the
    services. Positions (m) and orientation (quaternion; all zero: keep the present one) are relative to ``goal_frame``.
    switch_dmp does not change ``goal_frame``."""

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
    """Progress of the running DMP motion. ``state``: idle, running, reached, holding or aborted. ``code``: ReasonCode
    of ``reason``. ``remaining_distance`` in m. An empty ``primitive_id`` means that no progress has arrived yet."""

    state: str = "idle"
    reason: str = ""
    primitive_id: str = ""
    phase: float = 0.0
    remaining_distance: float = 0.0
    code: int = 0
    remaining_time: float = 0.0
    """s on the primitive's clock: follows dmp_ratio and ignores the slowing by limits"""


@dataclass(frozen=True)
class Located:
    """Location of an object: its tf2 frame, its pose in ``parent`` (xyz in m, quaternion), the age of the pose (s)."""

    frame: str
    parent: str
    xyz: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    age: float


@dataclass(frozen=True)
class HandState:
    """Fields of hand_status that the machines use. Positions of five motors: 0 open .. 254 closed; empty if unknown."""

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
    """Recognised motion of the person: class name ('unknown' if none), confidence 0..1; ``decided``: it is final."""

    pattern: str = "unknown"
    confidence: float = 0.0
    decided: bool = False
    scores: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Ahead:
    """Belief about the person's intention. ``offer``, ``request``: probability that the person offers an object, or
    wants the robot's object. ``frame``: tf2 frame of the predicted place of the handover, with its position in the base
    frame (m) and standard deviation (m); empty while no place is predicted."""

    offer: float = 0.0
    request: float = 0.0
    object_id: str = ""
    frame: str = ""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    deviation: float = 0.0


class ArmPort(Protocol):
    """The low-level cognitive controller and the LWR interface."""

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        """Load a controller plug-in; value: None. Succeeds if it is already loaded with that type."""

    def load_dmps(self, filename: str) -> Pending:
        """Load a library of primitives; value: their number."""

    def lwr_command(self, event: str) -> Pending:
        """Acknowledged command to the LWR interface (start, hold, reset, stop, position ...); value: its outcome, a
        sentence."""

    def motion_allowed(self) -> Verdict:
        """Returns whether the arm follows target velocities now; if not, the reason."""

    def standing(self) -> Verdict:
        """Returns whether the arm's set-point stands still (velocity and acceleration zero). If not, or if that is
        unknown: the reason."""

    def cancel_motion(self, reason: str) -> Pending:
        """End all running and waiting motions; the arm brakes within its limits. Value: None, when the set-point
        stands. Succeeds if there is nothing to end. This is the only request that is never withdrawn: it stays in force
        if the caller stops waiting."""

    def motion_limits(self) -> MotionLimits:
        """Returns the speed limits of the arm; the reduced ones while a reduced profile is in force."""

    def speed_scale(self) -> float:
        """Returns the ratio of the present to the planned speed of the reference, 0..1."""

    def switch_controller(self, controller_id: str) -> Pending:
        """Make a plug-in the active one; this ends the motion of the previous one. Value: its type."""

    def apply_profile(self, profile: str) -> Pending:
        """Enable exactly the feedback controllers of a named profile, all in the same cycle; value: None."""

    def profile_settled(self, profile: str) -> Verdict:
        """Returns whether this profile is in force and the corrections of all other feedback controllers have faded to
        zero. If not: the reason."""

    def execute_dmp(self, request: DmpRequest) -> Pending:
        """Start a DMP motion; value: None when it is accepted. The motion goes on, even if nobody waits, until it is
        cancelled, replaced or ended by a switch. cancel() ends it."""

    def switch_dmp(self, request: DmpRequest) -> Pending:
        """Replace the running primitive; phase, position and velocity are kept. Value: None."""

    def dmp_progress(self) -> DmpProgress:
        """Returns the newest progress since the last accepted execute_dmp."""

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        """Point-to-point motion (rad, rad/s); value: None when it has been completed. PortError with the reason if it
        ended earlier. The motion goes on if nobody waits; cancel() ends it."""

    def joint_positions(self) -> tuple[float, ...] | None:
        """Returns the measured joint positions (rad); None if unknown or older than 0.5 s."""

    def hold(self, reason: str) -> Pending:
        """Brake and latch. Does not affect the hand."""


class HandPort(Protocol):
    """The IH2 hand."""

    def calibrate(self, mode: str) -> Pending:
        """Calibrate (fast, complete, each also with ' force'); value: None at the end."""

    def preshape(self, mode: str, level: str) -> Pending:
        """Move to the preshape of a grasp mode; value: None."""

    def close_on_object(self) -> Pending:
        """Close the preshaped hand; value: None when it is closed or has stalled on an object."""

    def close(self, speed: int) -> Pending:
        """Close the fingers from their present positions with wire speed 1..511, which also sets the force; value: None
        when they stand still."""

    def open(self, speed: int) -> Pending:
        """Open with wire speed 1..511; value: None. cancel() stops the fingers where they are."""

    def state(self) -> HandState:
        """Returns the newest status; connected=False if the node has been silent for more than 1 s."""


OLDEST_BELIEF = 0.3  # s, oldest belief that is used
OLDEST_RECOGNITION = 0.5  # s, oldest recognition that is used


class PerceptionPort(Protocol):
    """The perception modules of any provider."""

    def init_vision(self, time_limit: float) -> Pending:
        """Start the modules; value: message, a sentence."""

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        """Locate an object (or 'human_hand'); value: Located."""

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        """Find free places on the board; value: list of Located in frame 'board', best first."""

    def recognition(self) -> Recognition:
        """Returns the newest recognition of the person's motion; an empty one if none has come for 0.5 s."""

    def ahead(self) -> Ahead:
        """Returns the newest belief about an offer or a request; an empty one if none has come for 0.3 s."""


class DatabasePort(Protocol):
    """The object database."""

    def get_object(self, object_id: str) -> Pending:
        """Get one entry; value: a dict that is valid against the object schema."""

    def list_objects(self) -> Pending:
        """List all object ids; value: list of str."""


class ContactPort(Protocol):
    """The contact trigger. wait_stop uses only this port, so that a tactile hand can replace the detector."""

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        """Delete old events and watch for one event; value: None when accepted. ``settings``: fields of the service
        ArmContact. Modes:

        'contact': an object touches the hand; the arm stands still. 'contact_in_motion': the same, moving or not.
        'load': the hand carries the object's weight. 'lift': the same, counted from now on, while the arm lifts.
        'release': the object's weight leaves the hand."""

    def disarm(self) -> None:
        """Stop watching."""

    def event(self) -> ContactEvent | None:
        """Returns the first event since arm(); None until then."""

    def share_gone(self) -> float | None:
        """Returns the certain part of the weight share that has left the hand since arming for 'release', also after
        the event. 0: none, 1: all, above 1: the person lifts the hand. None while nothing is watched."""

    def force(self) -> tuple[float, float, float] | None:
        """Returns the force (N) on the palm in the base frame, relative to the force before the last reach with
        'contact_in_motion'. It is measured with and without watching. It includes the object's weight until the
        detector is informed that the hand carries it. None if it is unknown or older than 0.1 s."""

    def grip(self) -> float | None:
        """Returns the grip force (N) of the fingers on the object; None if the hand cannot measure it."""
