"""One Robot for both cells: the running one (coglab.connect) and the one in virtual time (coglab.World).

Units: m, rad, s, N. Joints in wire order a1 a2 e1 a3 a4 a5 a6. Quaternions x y z w. Base frame of the arm: "world".
A request that is refused before anything moves raises Refused; wrong arguments raise ValueError; a time limit raises
TimeoutError. A motion or an exchange that has begun and fails returns a result with ``ok`` False and the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import TracebackType
from typing import Any, TypeAlias

import coglab_controllers as cc
import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.actions import WAYS_OUT
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import damped_step, default_arm, home_posture, joint_limits, solve
from coglab_smach.ports.interfaces import DmpRequest
from coglab_smach.ports.pending import Pending, PortError
from ih2_hand.grasps import CLOSING_MOTORS, LEVELS, levels_of
from numpy.typing import ArrayLike

from coglab.back_end import BackEnd
from coglab.results import Event, Exchange, MotionResult, Refused, Result, RobotState
from coglab.values import finite, has_shape, joints_of, number, pose_of

PoseLike: TypeAlias = Pose | Sequence[Any] | np.ndarray

JOINT_NAMES = ("a1", "a2", "e1", "a3", "a4", "a5", "a6")
POLL = 0.005  # s between two looks of a wait
ANSWER = 5.0  # s, time limit for an answer that takes no motion
STOPPING = 8.0  # s, time limit for the arm to stand after a stop
LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))
OWN_FRAME = "coglab_goal"  # goal frame of a motion toward a pose, or along a function
UNSET = (0.0, 0.0, 0.0, 0.0)
GUIDE_MODE = "joint_impedance stiffness 0.01 damping 0.3"  # the smallest stiffness that the arm takes, Nm/rad
SILENT = "the arm has sent no joint positions for 0.5 s: does it run? ./coglab status"
GUIDE_ANSWER = 10.0  # s, time limit for a change of the arm's mode


class Motion:
    """A motion that runs. A context manager: leaving the block stops the arm and waits until it stands. Example::

    with robot.arm.start_reach("reach_human", "human_hand") as motion:
        while not motion.done and robot.arm.palm.position[0] < 0.7:
            world.step(0.01)
    """

    def __init__(self, robot: Robot, what: str, limit: float, look: Callable[[], MotionResult | None]) -> None:
        self.what = what
        self._robot, self._look = robot, look
        self.started = robot.time
        self._limit = limit
        self._result: MotionResult | None = None

    @property
    def done(self) -> bool:
        """True if the motion has ended."""
        if self._result is None:
            self._robot._check()
            self._result = self._look()
        return self._result is not None

    @property
    def result(self) -> MotionResult:
        """Result of an ended motion. RuntimeError while it runs."""
        if not self.done or self._result is None:
            raise RuntimeError(f"'{self.what}' still runs: call wait(), or cancel()")
        return self._result

    def wait(self, limit: float | None = None) -> MotionResult:
        """Wait for the end. TimeoutError after ``limit`` s (default: that of the request); the arm is stopped first.
        Any other exception, such as Ctrl-C, stops the arm too."""
        limit = self._limit if limit is None else number(limit, "limit", "s", 0.0)
        try:
            self._robot._wait(lambda: self.done, limit, f"the end of '{self.what}'")
        except BaseException:
            self.cancel("its caller has given up waiting")
            raise
        return self.result

    def cancel(self, reason: str = "cancelled by its caller") -> MotionResult:
        """Stop the arm and wait until it stands. Returns the result; that of an ended motion does not change."""
        if self._result is None:
            self._robot._halt(reason)
            if not self.done:
                code = ReasonCode.CANCELLED
                self._result = self._robot.arm._result(self.what, self.started, False, code, reason)
        return self.result

    def __enter__(self) -> Motion:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.cancel("its with block has ended")


class Arm:
    """The arm of a Robot. Each method waits for the end of its motion and returns a MotionResult; the ``start_`` forms
    return the running Motion."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._cell = robot, robot._cell
        self._prepared = False

    @property
    def joints(self) -> np.ndarray:
        """Measured joint positions, rad, shape (7,). RuntimeError if the arm is silent."""
        self._robot._check()
        position = self._cell.arm.joint_positions()
        if position is None:
            raise RuntimeError(SILENT)
        return np.array(position)

    @property
    def palm(self) -> Pose:
        """Pose of the palm (frame ih2_palm) in the base frame, from the measured joints."""
        return Pose(*default_arm().fk(self.joints))

    @property
    def home(self) -> np.ndarray:
        """Joint positions at home, rad, shape (7,)."""
        return home_posture().copy()

    def move_joints(self, joints: ArrayLike, duration: float | None = None, *, limit: float = 30.0) -> MotionResult:
        """Move in joint space, all joints at once.

        ``joints``: target, rad, shape (7,). ``duration``: s, if it shall take longer than at default speed, or shorter
        up to the limits of the arm; limits of the palm's speed may stretch it.
        """
        return self.start_joints(joints, duration, limit=limit).wait()

    def start_joints(self, joints: ArrayLike, duration: float | None = None, *, limit: float = 30.0) -> Motion:
        """Start ``move_joints`` and return it while it runs."""
        target = joints_of(joints, "joints")
        _within_limits(target)
        limit = number(limit, "limit", "s", 0.0)
        velocity: list[float] = []
        if duration is not None:
            velocity = self._speeds(target, number(duration, "duration", "s", 0.0))
        self._ready("ptp")
        begun = self._robot.time
        pending = self._cell.arm.move_ptp(target.tolist(), velocity)
        self._robot._pause(2 * POLL)
        _raise_refusal(pending)

        def look() -> MotionResult | None:
            if not pending.done():
                return None
            try:
                pending.result()
            except PortError as error:
                return self._failed("move_joints", begun, error, float(np.abs(self.joints - target).max()))
            return self._result("move_joints", begun, True, remaining=float(np.abs(self.joints - target).max()))

        return self._begin(Motion(self._robot, "move_joints", limit, look))

    def move_to(
        self,
        target: PoseLike | str,
        offset: PoseLike | None = None,
        duration: float | None = None,
        *,
        limit: float = 30.0,
    ) -> MotionResult:
        """Bring the palm to a pose, in joint space. A frame counts at its present place; it is not followed.

        ``target``: a Pose in the base frame, (position [3] m, quaternion [4]), 7 numbers, a 4 x 4 matrix, the name of a
        frame, such as "object_mug", or a position [3], which keeps the orientation of the palm. ``offset``: pose of the
        palm relative to the target. Refused: out of reach.
        """
        return self.start_to(target, offset, duration, limit=limit).wait()

    def start_to(
        self,
        target: PoseLike | str,
        offset: PoseLike | None = None,
        duration: float | None = None,
        *,
        limit: float = 30.0,
    ) -> Motion:
        """Start ``move_to`` and return it while it runs."""
        if isinstance(target, str):
            pose = self._robot.frame(target)
        elif not isinstance(target, Pose) and has_shape(target, (3,)):
            pose = Pose(finite(target, "target", (3,)), self.palm.orientation)
        else:
            pose = pose_of(target, "target")
        if offset is not None:
            pose = pose * pose_of(offset, "offset")
        posture = _posture(pose, self.joints)
        if posture is None:
            place = np.array2string(pose.position, precision=3)
            raise Refused(
                f"the palm cannot be brought to {place} m with that orientation: choose a nearer pose, or another "
                "orientation",
                ReasonCode.GOAL_UNREACHABLE,
            )
        return self.start_joints(posture, duration, limit=limit)

    def reach(
        self,
        primitive: str,
        frame: str | PoseLike | ArrayLike,
        offset: PoseLike | ArrayLike | None = None,
        ratio: float = 1.0,
        *,
        limit: float = 30.0,
    ) -> MotionResult:
        """Run a motion primitive to a frame, and follow the frame if it moves.

        ``primitive``: of the loaded library, such as "reach_human". ``frame``: name, or a pose or position in the
        base frame.
        ``offset``: goal of the palm relative to the frame: a pose, or a position [3] m, which leaves the orientation
        free. ``ratio``: 2 takes twice as long as demonstrated.
        """
        return self.start_reach(primitive, frame, offset, ratio, limit=limit).wait()

    def start_reach(
        self,
        primitive: str,
        frame: str | PoseLike | ArrayLike,
        offset: PoseLike | ArrayLike | None = None,
        ratio: float = 1.0,
        *,
        limit: float = 30.0,
    ) -> Motion:
        """Start ``reach`` and return it while it runs."""
        if not isinstance(primitive, str) or not primitive:
            raise ValueError(f"primitive: a name such as 'reach_human' is expected, got {primitive!r}")
        ratio = number(ratio, "ratio", "times the demonstrated duration", 0.0)
        limit = number(limit, "limit", "s", 0.0)
        name = frame if isinstance(frame, str) else OWN_FRAME
        if not isinstance(frame, str):
            if offset is None and not isinstance(frame, Pose) and has_shape(frame, (3,)):
                offset = (0.0, 0.0, 0.0)  # a bare position leaves the orientation free
            self._show(_place_of(frame, "frame"))
        position, orientation = _goal_of(offset)
        self._ready("dmp")
        begun = self._robot.time
        request = DmpRequest(primitive, name, position, ratio, any(orientation), orientation)
        self._robot._await(self._cell.arm.execute_dmp(request), ANSWER, f"the answer to reach '{primitive}'")
        self._robot._pause(2 * POLL)  # until the progress belongs to this motion
        return self._begin(Motion(self._robot, "reach", limit, lambda: self._look_at_reach(begun)))

    def follow(
        self,
        target: str | Callable[[float], Any],
        seconds: float,
        offset: PoseLike | ArrayLike | None = None,
        primitive: str = "reach_human",
        *,
        limit: float | None = None,
    ) -> MotionResult:
        """Follow a frame, or a function of time, for ``seconds``; then the arm stops.

        ``target``: name of a frame, or a function: s since the start -> a position [3] m, or a pose, in the base frame.
        ``offset``: as in ``reach``. The palm comes to the target with ``primitive``, and then stays within 3 cm of it.
        ``limit``: s, by default 10 s more than ``seconds``.
        """
        seconds = number(seconds, "seconds", "s", 0.0)
        limit = seconds + 10.0 if limit is None else number(limit, "limit", "s", 0.0)
        begun = self._robot.time
        name = target if isinstance(target, str) else OWN_FRAME
        if not isinstance(target, str):
            if not callable(target):
                raise ValueError(f"target: the name of a frame or a function of time is expected, got {target!r}")
            first = target(0.0)
            if has_shape(first, (3,)) and not isinstance(first, Pose) and offset is None:
                offset = (0.0, 0.0, 0.0)  # a position leaves the orientation free
            self._show(_place_of(first, "target(t)"))
        with self.start_reach(primitive, name, offset, limit=limit) as motion:
            end = begun + seconds
            while self._robot.time < end:
                if self._robot.time - begun > limit:
                    raise TimeoutError(f"follow has not ended within {limit:g} s")
                if not isinstance(target, str):
                    self._cell.show_frame(name, _place_of(target(self._robot.time - begun), "target(t)"))
                self._robot._pause(POLL)
                if motion.done and not motion.result.ok:
                    return replace(motion.result, what="follow")
            remaining = self._cell.arm.dmp_progress().remaining_distance
        return self._result("follow", begun, True, remaining=float(remaining))

    @contextmanager
    def guided(self) -> Iterator[None]:
        """Inside the block a person can lead the arm by hand: joint impedance with almost no stiffness, the robot
        controller carries its weight. Afterwards it stands at its last place, in position mode. The brain may
        stop while the arm changes its mode: ``robot.reset()`` brings arm and brain home. Example::

            with robot.arm.guided():
                robot.pause(10.0)  # lead the hand
            print(robot.arm.joints)

        Refused: the brain acts, the hand holds an object (the arm would sink under its weight), or the arm has no such
        mode (``arm:=ideal``). On a real arm the load data of the tool must be right, or the arm sinks: hold it.
        """
        robot, arm = self._robot, self._cell.arm
        robot._check()
        robot._end_own_motion("hand guiding of the same caller")
        robot._await_hub("hand guiding")
        if held := robot.state.holding:
            raise Refused(f"the hand holds '{held}', and the arm would sink under its weight: give it or put it first")

        def command(*events: str) -> None:
            for event in events:
                robot._await(arm.lwr_command(event), GUIDE_ANSWER, f"the answer to '{event}'")

        try:
            command("stop", GUIDE_MODE, "start")
            yield
        finally:
            command("stop", "position", "start")
            robot._wait(lambda: arm.motion_allowed().ok, ANSWER, "the arm to stand in position mode")

    def _show(self, pose: Pose) -> None:
        """Show the goal frame of this object, and wait until the robot knows it."""
        self._robot._check()
        self._cell.show_frame(OWN_FRAME, pose)
        self._robot._pause(self._cell.frame_delay)

    def _look_at_reach(self, begun: float) -> MotionResult | None:
        arm = self._cell.arm
        progress = arm.dmp_progress()
        remaining = float(progress.remaining_distance)
        if progress.state == "reached":
            return self._result("reach", begun, True, remaining=remaining)
        if progress.state == "aborted":
            why = progress.reason or "the controller gave no reason"
            return self._result("reach", begun, False, progress.code, why, (), remaining)
        allowed = arm.motion_allowed()
        if not allowed.ok:
            error = PortError("the arm does not follow any more", (allowed.why,), allowed.code)
            return self._failed("reach", begun, error, remaining)
        return None

    def _begin(self, motion: Motion) -> Motion:
        self._robot._motion = motion
        return motion

    def _ready(self, controller: str) -> None:
        """Refused unless the arm may move. Ends the caller's previous motion and switches the controller."""
        robot, arm = self._robot, self._cell.arm
        robot._check()
        robot._end_own_motion("a newer motion of the same caller")
        robot._await_hub("a motion")
        allowed = arm.motion_allowed()
        if not allowed.ok:
            raise Refused(f"the arm cannot move: {allowed.why}; call robot.reset()", allowed.code)
        if not self._prepared:
            for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
                robot._await(arm.load_controller(name, kind), 20.0, f"the controller '{name}'")
            if not self._cell.actions:  # otherwise the brain has loaded its own library
                robot._await(arm.load_dmps(LIBRARY), ANSWER, "the library of primitives")
            self._prepared = True
        robot._await(arm.switch_controller(controller), ANSWER, f"the switch to '{controller}'")

    def _speeds(self, target: np.ndarray, duration: float) -> list[float]:
        """Joint speeds (rad/s) for which the motion to ``target`` takes ``duration`` s."""
        limits = self._cell.arm.motion_limits()
        fastest, acceleration = np.array(limits.velocity), np.array(limits.ptp_acceleration)
        here, rest = self.joints, np.zeros(7)

        def time(share: float) -> float:
            return float(cc.PtpTrajectory(here, rest, target, share * fastest, acceleration).duration)

        if time(1.0) > duration:
            raise ValueError(f"duration: this motion takes {time(1.0):.2f} s at least, got {duration:g} s")
        low, high = 1e-3, 1.0
        for _ in range(40):
            middle = (low * high) ** 0.5
            low, high = (middle, high) if time(middle) > duration else (low, middle)
        return [float(v) for v in high * fastest]

    def _failed(self, what: str, begun: float, error: PortError, remaining: float) -> MotionResult:
        return self._result(what, begun, False, error.code, error.sentence, error.causes, remaining)

    def _result(
        self,
        what: str,
        begun: float,
        ok: bool,
        code: int = ReasonCode.NONE,
        sentence: str = "",
        causes: tuple[str, ...] = (),
        remaining: float = 0.0,
    ) -> MotionResult:
        position = self._cell.arm.joint_positions()
        joints = np.full(7, np.nan) if position is None else np.array(position)
        palm = Pose(np.full(3, np.nan)) if position is None else Pose(*default_arm().fk(joints))
        end = self._robot.time
        return MotionResult(what, ok, int(code), sentence, tuple(causes), begun, end, joints, palm, remaining)


class Hand:
    """The hand of a Robot. Each method waits until the fingers stand, and returns a Result."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    @property
    def fingers(self) -> tuple[int, ...]:
        """Positions of the five motors (thumb abduction, thumb, index, middle, ring and little), 0 open .. 254 closed;
        empty if unknown."""
        return self._port().state().positions

    @property
    def holding(self) -> bool:
        """True if the motors feel an object between the fingers."""
        return bool(self._port().state().holding)

    def preshape(self, name: str, level: str | None = None, *, limit: float = 10.0) -> Result:
        """Prepare a grasp: "cylindrical", "lateral", "tridigit", "bidigit", "tridigit2" or "bidigit2". ``level``: force
        of the later grasp, "low", "medium" or "high"; None: the lowest one that every hand has for this grasp."""
        if name not in CLOSING_MOTORS:
            raise ValueError(f"name: one of {', '.join(CLOSING_MOTORS)} is expected, got {name!r}")
        force = levels_of(name, "legacy")[0] if level is None else level
        if force not in LEVELS:
            raise ValueError(f"level: one of {', '.join(LEVELS)} is expected, got {level!r}")
        self._empty("preshape")
        return self._do(f"preshape {name}", lambda: self._port().preshape(name, force), limit)

    def close(self, speed: int | None = None, *, limit: float = 10.0) -> Result:
        """Close the fingers: the preshaped grasp, or with ``speed`` (1 .. 511, sets the force too) from their present
        positions."""
        if speed is None:
            return self._do("close", lambda: self._port().close_on_object(), limit)
        wire = _wire(speed)
        return self._do("close", lambda: self._port().close(wire), limit)

    def open(self, speed: int = 300, *, drop: bool = False, limit: float = 10.0) -> Result:
        """Open the fingers, ``speed`` 1 .. 511. Refused while the hand holds an object, unless ``drop``."""
        wire = _wire(speed)
        if not drop:
            self._empty("open")
        return self._do("open", lambda: self._port().open(wire), limit)

    def _port(self) -> Any:
        self._robot._check()
        port = self._robot._cell.hand
        if port is None:
            raise Refused("this robot has no hand: ./coglab launch without arm:=ideal starts one", 110)
        return port

    def _empty(self, what: str) -> None:
        self._port()
        held = self._robot._cell.state().object_id
        if held:
            raise Refused(
                f"hand.{what} would drop the {held}: call give() or put(), or hand.open(drop=True)",
                ReasonCode.WRONG_STATE,
            )

    def _do(self, what: str, start: Callable[[], Pending], limit: float) -> Result:
        robot = self._robot
        limit = number(limit, "limit", "s", 0.0)
        self._port()
        robot._await_hub(f"hand.{what.split()[0]}")
        begun = robot.time
        pending = start()
        try:
            robot._wait(pending.done, limit, f"the end of hand.{what}")
        except BaseException:
            pending.cancel()
            raise
        try:
            pending.result()
        except PortError as error:
            why = (error.sentence, error.causes)
            if error.code == ReasonCode.HAND_REFUSED or error.code < 200:
                raise Refused(f"{why[0]}{''.join(f', because {c}' for c in why[1])}", error.code) from None
            return Result(f"hand.{what}", False, int(error.code), *why, begun, robot.time)
        return Result(f"hand.{what}", True, started=begun, ended=robot.time)


class Robot:
    """The robot: ``arm``, ``hand``, and the actions of its state machines. From coglab.connect() or ``World.robot``.

    A context manager: leaving the block stops a motion or an exchange that this object has started, and waits until the
    arm stands.
    """

    def __init__(self, cell: BackEnd, close: Callable[[], None] = lambda: None) -> None:
        self._cell, self._close = cell, close
        self._closed = False
        self._motion: Motion | None = None
        self.arm = Arm(self)
        self.hand = Hand(self)

    # --- actions of the state machines ---

    def receive(self, object: str | None = None, *, limit: float = 60.0) -> Exchange:
        """Take an object that a person offers. ``object``: its id; None: the object of the World, or the
        default object of a running robot's machines."""
        return self._act("receive", object, limit)

    def give(self, object: str | None = None, *, delivery: str | None = None, limit: float = 60.0) -> Exchange:
        """Give the object in the hand to a person. ``object``: needed only if its name is not known. ``delivery``: one
        of those in the object's file; None: its default."""
        return self.do("give", object, delivery=delivery, limit=limit)

    def take(self, object: str | None = None, *, limit: float = 60.0) -> Exchange:
        """Take an object from the board. ``object``: as in ``receive``."""
        return self._act("take", object, limit)

    def put(self, object: str | None = None, *, limit: float = 60.0) -> Exchange:
        """Put the object in the hand on the board."""
        return self._act("put", object, limit)

    def do(
        self, action: str, object: str | None = None, *, delivery: str | None = None, limit: float = 60.0
    ) -> Exchange:
        """Execute an action by its name: receive, give, take, put, or one of your own that machines.yaml names.
        ``object``, ``delivery``: as in ``receive`` and ``give``."""
        if delivery is not None and (not isinstance(delivery, str) or not delivery or "/" in delivery):
            raise ValueError(f"delivery: a name of the object's file is expected, got {delivery!r}")
        if object is not None and (not isinstance(object, str) or "/" in object):
            raise ValueError(f"object: an id such as 'mug' is expected, got {object!r}")
        if not isinstance(action, str):
            raise ValueError(f"action: a name such as 'receive' is expected, got {action!r}")
        return self._act(action, f"{object or ''}/{delivery}" if delivery else object, limit)

    def stop(self, reason: str = "stopped from Python", *, limit: float = STOPPING) -> Result:
        """STOP: the arm brakes, the brain ends its action, the hand keeps its object. Latched until ``reset()``. No
        safety function: that is the red button of the robot controller."""
        self._check()
        begun = self.time
        self._cell.stop(reason)
        result = self._come_to_rest("stop", begun, limit)
        self._wait(lambda: not self._cell.actions or self._resettable(), limit, "the end of the brain's action")
        return result

    def hold(self, reason: str = "held from Python", *, limit: float = STOPPING) -> Result:
        """Brake the arm and latch until ``reset()``."""
        self._check()
        begun = self.time
        self._await(self._cell.arm.hold(reason), ANSWER, "the answer to hold")
        return self._come_to_rest("hold", begun, limit)

    def reset(self, *, limit: float = 60.0) -> Result:
        """Release a stop, hold or fault, and wait until the robot can act again. The brain brings the arm home."""
        self._check()
        begun, arm = self.time, self._cell.arm
        limit = number(limit, "limit", "s", 0.0)
        if not self._cell.actions:
            self._enable_arm()
        else:
            self._wait(lambda: self._resettable() or self._in_order(), limit, "a hub of the brain")
            if self._resettable():
                action = self._ask_for_reset()
                self._wait(lambda: not self._resettable(), limit, "the brain to leave its stop")
                self._wait(lambda: self._cell.state().in_hub, limit, f"a hub after '{action}'")
        state = self._cell.state()
        ok = arm.motion_allowed().ok and not self._resettable()
        return Result("reset", ok, 0 if ok else state.reason_code, "" if ok else state.why, (), begun, self.time)

    # --- state ---

    @property
    def time(self) -> float:
        """s: virtual time of a World, ROS time of a running robot."""
        return self._cell.now()

    @property
    def state(self) -> RobotState:
        """Present state of robot and brain."""
        self._check()
        brain, arm, hand = self._cell.state(), self._cell.arm, self._cell.hand
        allowed, position = arm.motion_allowed(), arm.joint_positions()
        joints = np.full(7, np.nan) if position is None else np.array(position)
        palm = Pose(np.full(3, np.nan)) if position is None else Pose(*default_arm().fk(joints))
        short = {action: name for name, action in self._cell.actions.items()}
        return RobotState(
            self.time,
            brain.state,
            tuple(short.get(action, action) for action in brain.actions),
            brain.object_id,
            brain.why,
            brain.reason_code,
            brain.waits_for,
            allowed.ok,
            allowed.why,
            arm.standing().ok,
            joints,
            palm,
            () if hand is None else hand.state().positions,
        )

    def events(self) -> list[Event]:
        """Returns the events since the last call: transitions of the machines, results, and messages to the
        person. The newest 10 000 are kept."""
        self._check()
        return self._cell.events()

    def frame(self, name: str) -> Pose:
        """Pose of a frame in the base frame as the robot sees it: "palm", "human_hand", "object_mug", "board", ...
        Refused: never seen, or not seen for 1 s."""
        return self.seen(name)[0]

    def seen(self, name: str) -> tuple[Pose, float]:
        """Like ``frame``, with the age of the sight, s."""
        self._check()
        pose, age = self._cell.frame(str(name))
        if pose is None and name == "palm":
            raise Refused(SILENT, ReasonCode.NODE_SILENT)
        if pose is None:
            raise Refused(f"the frame '{name}' was never seen; is its name right?", ReasonCode.GOAL_MISSING)
        if age > 1.0:
            raise Refused(f"the frame '{name}' was last seen {age:.1f} s ago", ReasonCode.GOAL_STALE)
        return pose, age

    def pause(self, seconds: float) -> None:
        """Let time pass: virtual time in a World."""
        self._check()
        self._pause(number(seconds, "seconds", "s", 0.0))

    # --- end ---

    def close(self) -> None:
        """Stop the motion of this object, wait until the arm stands, and disconnect. May be called twice."""
        if self._closed:
            return
        try:
            self._end_own_motion("its robot object was closed")
        finally:
            self._closed = True
            self._close()

    def __enter__(self) -> Robot:
        self._check()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- waiting ---

    def _check(self) -> None:
        if self._closed:
            raise RuntimeError("this robot was closed: connect again, or open another World")
        self._cell.check()

    def _pause(self, seconds: float) -> None:
        self._cell.pause(seconds)

    def _wait(self, condition: Callable[[], bool], limit: float, what: str) -> None:
        """Let time pass until the condition is true. TimeoutError names ``what``."""
        end = self._cell.clock() + limit
        while not condition():
            if self._cell.clock() >= end:
                raise TimeoutError(f"{what} did not come within {limit:g} s: {self._now_in_words()}")
            self._pause(POLL)

    def _await(self, pending: Pending, limit: float, what: str) -> Any:
        """Returns the value of a pending answer. Raises Refused for a refusal."""
        try:
            self._wait(pending.done, limit, what)
        except BaseException:
            pending.cancel()
            raise
        try:
            return pending.result()
        except PortError as error:
            because = "".join(f", because {cause}" for cause in error.causes)
            raise Refused(f"{error.sentence}{because}", error.code) from None

    def _now_in_words(self) -> str:
        if not self._cell.actions:
            allowed = self._cell.arm.motion_allowed()
            return "the arm can move" if allowed.ok else f"the arm cannot move: {allowed.why}"
        state = self._cell.state()
        waits = f" and waits for {state.waits_for}" if state.waits_for else ""
        return f"the brain is in {state.state or 'no state'}{waits}" + (f"; {state.why}" if state.why else "")

    def _await_hub(self, what: str) -> None:
        """Refused unless the brain waits in a hub in which the arm may be moved."""
        if not self._cell.actions:
            return
        if not self._cell.state().in_hub:
            try:
                self._wait(lambda: self._cell.state().in_hub, ANSWER, "a hub of the brain")
            except TimeoutError:
                raise Refused(
                    f"{what} is refused while an action runs ({self._now_in_words()}): wait for its end, or stop()",
                    ReasonCode.BUSY,
                ) from None
        if self._resettable():
            why = self._cell.state().why
            raise Refused(f"{what} is refused: {why or 'stopped'}; call robot.reset()", 601)

    def _resettable(self) -> bool:
        return bool(set(WAYS_OUT) & set(self._cell.state().actions))

    def _ask_for_reset(self) -> str:
        """Ask for the action that leads out of the stop, and return it. A stop may become a fault meanwhile, which
        takes another action."""
        end = self._cell.clock() + ANSWER
        while True:
            action = "reset" if "reset" in self._cell.state().actions else "initialise"
            answer = self._cell.submit(action, "")
            if answer.ok:
                return action
            if self._cell.clock() >= end:
                raise Refused(answer.message, answer.code)
            self._pause(0.1)

    def _in_order(self) -> bool:
        return self._cell.state().in_hub and self._cell.arm.motion_allowed().ok

    def _act(self, name: str, object_id: str | None, limit: float) -> Exchange:
        self._check()
        limit = number(limit, "limit", "s", 0.0)
        if object_id is not None and not isinstance(object_id, str):
            raise ValueError(f"object: an id such as 'mug' is expected, got {object_id!r}")
        cell = self._cell
        if not cell.actions:
            raise Refused(f"this robot has no brain for '{name}': ./coglab launch without arm:=ideal starts one", 110)
        action = cell.actions.get(name, name)
        self._end_own_motion(f"'{name}' begins")
        self._wait(lambda: cell.state().in_hub, limit, f"a hub of the brain before '{name}'")
        if action not in cell.state().actions:
            raise Refused(self._wrong_hub(name), ReasonCode.WRONG_STATE)
        answer = cell.submit(action, object_id or "")
        if not answer.ok:
            raise Refused(answer.message, answer.code)
        found: list[Exchange] = []

        def over() -> bool:
            result = cell.result(action)
            if result is not None and not found:
                found.append(replace(result, what=name))
            return bool(found)

        try:
            self._wait(over, limit, f"the end of '{name}'")
            self._wait(lambda: cell.state().in_hub, ANSWER, f"a hub after '{name}'")
        except BaseException as error:
            self._halt_exchange(f"'{name}' was given up by its caller")
            if isinstance(error, TimeoutError):
                raise TimeoutError(f"{error}. The robot was stopped; robot.reset() goes on.") from None
            raise
        return found[0]

    def _wrong_hub(self, name: str) -> str:
        state = self.state
        if self._resettable():
            return f"'{name}' is refused: {state.why or 'the robot is stopped'}; call robot.reset()"
        if name not in self._cell.actions and name not in state.actions:
            known = ", ".join(
                [*self._cell.actions, *(each for each in state.actions if each not in self._cell.actions)]
            )
            return f"'{name}' is no action that can be requested now; there are {known}"
        held = f"the hand holds the {state.holding}" if state.holding else "the hand is empty"
        own = [each for each in state.actions if each not in self._cell.actions]
        can = " or ".join(f"do('{each}')" if each in own else f"{each}()" for each in state.actions)
        return f"'{name}' is refused: {held}; call {can} first"

    def _halt_exchange(self, reason: str) -> None:
        """STOP and wait until the arm stands, without a new error."""
        try:
            self._cell.stop(reason)
            self._wait(self._stands, STOPPING, "the arm to stand")
            self._wait(self._at_rest, STOPPING, "the end of the brain's action")
        except (TimeoutError, RuntimeError, PortError):
            pass  # the caller gets the first error

    def _at_rest(self) -> bool:
        return not self._cell.actions or self._cell.state().in_hub

    def _halt(self, reason: str) -> None:
        """End every motion and wait until the arm stands."""
        pending = self._cell.arm.cancel_motion(reason)
        self._wait(lambda: pending.done() and self._stands(), STOPPING, "the arm to stand")

    def _end_own_motion(self, reason: str) -> None:
        motion, self._motion = self._motion, None
        if motion is not None and not motion.done:
            motion.cancel(reason)

    def _stands(self) -> bool:
        return bool(self._cell.arm.standing().ok)

    def _come_to_rest(self, what: str, begun: float, limit: float) -> Result:
        limit = number(limit, "limit", "s", 0.0)
        self._wait(
            lambda: self._stands() and not self._cell.arm.motion_allowed().ok, limit, "the arm to stand, latched"
        )
        return Result(what, True, started=begun, ended=self.time)

    def _enable_arm(self) -> None:
        """Without a brain: reset the latch, and start command mode if needed."""
        arm = self._cell.arm
        if arm.motion_allowed().ok:
            return
        self._await(arm.lwr_command("reset"), ANSWER, "the answer to reset")
        self._pause(0.3)
        if not arm.motion_allowed().ok:
            self._await(arm.lwr_command("start"), 20.0, "the answer to start")
        self._wait(lambda: arm.motion_allowed().ok, 10.0, "command mode of the arm")


def _raise_refusal(pending: Pending) -> None:
    """Refused if the request ended at once because it was refused. Other ends are results."""
    if not pending.done():
        return
    try:
        pending.result()
    except PortError as error:
        if error.code < 200:
            raise Refused("; ".join((error.sentence, *error.causes)), error.code) from None


def _within_limits(joints: np.ndarray) -> None:
    limits = joint_limits()
    for name, value, low, high in zip(JOINT_NAMES, joints, limits.lower_position, limits.upper_position, strict=True):
        if not low <= value <= high:
            raise ValueError(f"joints: {name} must be {low:.4f} .. {high:.4f} rad, got {value:.4f}")


def _posture(target: Pose, start: np.ndarray) -> np.ndarray | None:
    """Joint positions that bring the palm to a pose within 0.1 mm and 0.01 deg; None if it is out of reach."""
    arm, limits = default_arm(), joint_limits()
    for begin in (start, home_posture()):
        near = solve(arm, target, begin.tolist())
        if near is None:
            continue
        posture: np.ndarray = near
        for _ in range(20):
            position, orientation = arm.fk(posture)
            turn = (target.rotation * Pose(position, orientation).rotation.inv()).as_rotvec()
            way = target.position - position
            if np.abs(way).max() < 1e-4 and np.abs(turn).max() < 2e-4:
                return posture
            posture = posture + damped_step(arm.jacobian(posture), way, turn, 1e-8 * np.eye(6))
            posture = np.clip(posture, limits.lower_position, limits.upper_position)
    return None


def _goal_of(offset: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position and orientation of the palm relative to the goal frame. A bare position leaves the orientation free."""
    if offset is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    if not isinstance(offset, Pose) and has_shape(offset, (3,)):
        x, y, z = finite(offset, "offset", (3,))
        return (float(x), float(y), float(z)), UNSET
    pose = pose_of(offset, "offset")
    return tuple(map(float, pose.position)), tuple(map(float, pose.orientation))


def _place_of(value: Any, name: str) -> Pose:
    """A pose, or a bare position [3]."""
    if not isinstance(value, Pose) and has_shape(value, (3,)):
        return Pose(finite(value, name, (3,)))
    return pose_of(value, name)


def _wire(speed: int) -> int:
    if isinstance(speed, bool) or not isinstance(speed, int | np.integer) or not 1 <= speed <= 511:
        raise ValueError(f"speed: a whole number 1 .. 511 is expected, got {speed!r}")
    return int(speed)
