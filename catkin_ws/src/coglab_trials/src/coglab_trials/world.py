"""The whole cell in one process and in virtual time: the robot (KRC stand-in, bridge and controller manager, byte for
byte in lockstep), the hand emulator behind its driver, virtual human, tracker."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import gt, truediv
from types import SimpleNamespace
from typing import Any

import coglab_controllers as cc
import numpy as np
import yaml
from coglab_objects.database import cell_parameters, objects_folder, read_object
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z
from coglab_py.yaml_file import read
from coglab_sim.person.in_cell import move_person, pose_of_truth, view_of
from coglab_sim.person.recorded_person import RecordedPerson, open_recorded_hand, scene_of
from coglab_sim.person.scene import Scene
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_sim.tracker.tracker import Sight, Tracker
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.physical_motor import MotorState
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.memory import HandMemory
from ih2_hand.progress import Task, Verdict
from ih2_hand.reasons import Reason

from coglab_trials.conditions import Conditions

try:
    import coglab_sim._cell  # noqa: F401  (knows the type of LockstepRobot.cell)
    from coglab_sim._virtual import LockstepRobot
except ImportError as error:
    raise ImportError(
        f"the simulated cell cannot be loaded ({error}): its library is missing or was not built; "
        "run ./coglab build, which also installs Debian's libmujoco-dev"
    ) from error

LIMITS = str(package_path("lwr_description", "config", "joint_limits.yaml"))
BOARD = Pose(np.array([0.45, -0.55, 0.05]), about_z(-np.pi / 2))
"""of the frame board in world"""
DT = 0.005
"""s, FRI period"""
FLOAT32 = 5e-4
"""rad/s, what rounding to float32 on the wire adds to a velocity between two answers"""
TASK_LIMIT = 8.0
"""s, of a preshape or a grasp"""
OLDEST = 1e9
"""s, age of a frame that was never seen"""


def urdf_file() -> str:
    """Path of the robot description."""
    return str(package_path("lwr_description", "urdf", "lwr_ih2.urdf"))


def manager_parameters() -> dict[str, Any]:
    """The parameters of /controller_manager as the launch file loads them."""
    file = package_path("coglab_controllers", "config", "controllers.yaml")
    parameters: dict[str, Any] = read(file).value
    package, _, path = parameters["feedback_file"].removeprefix("package://").partition("/")
    parameters["feedback_file"] = str(package_path(package, path))
    return parameters


class Robot:
    """LockstepRobot with what figures and detectors need of each period.

    ``cell``: parameters of the simulated cell, ``__`` for ``/`` in their names; ``limits``: table of joint limits.
    """

    def __init__(self, seed: int, limits: str = LIMITS, **cell: Any) -> None:
        parameters = {
            "seed": int(seed),
            "krc/period": DT,
            "contact/board_center": list(BOARD.position),
            **{name.replace("__", "/"): value for name, value in cell.items()},
        }
        self.parameters = {**manager_parameters(), "joint_limits_file": limits}
        self.virtual = LockstepRobot(urdf_file(), limits, parameters, yaml.safe_dump(manager_parameters()))
        self.cell = self.virtual.cell
        self.limits = cc.load_joint_limits(limits)
        # Plain floats: seven numbers are compared sooner by hand than by arrays, and that 200 times a second.
        self._fastest_to_command = [float(speed) for speed in self.limits.velocity]
        self._fastest = [float(v) for v in read(limits).value["default"]["velocity"]]
        lowest, highest = self.limits.lower_position, self.limits.upper_position
        self._range = [(float(low), float(high)) for low, high in zip(lowest, highest, strict=True)]
        with open(urdf_file(), encoding="utf-8") as stream:
            self.urdf = stream.read()
        self.chain = cc.Chain(self.urdf)
        self.report = self.virtual.report()
        self.progress: dict[str, Any] = {
            "motion": "idle",
            "reason": "",
            "primitive": "",
            "phase": 0.0,
            "remaining_distance": 0.0,
            "remaining_time": 0.0,
        }
        self.ended: dict[int, dict[str, Any]] = {}
        self.loaded: dict[str, str] = {}
        self.peak_share = self.measured_share = 0.0
        self.outside = {"commanded": 0, "measured": 0, "over_command": 0}
        self.silent = 0.0
        """s for which the robot's process has stood still (``virtual.frozen``)"""
        self.debug: dict[str, Any] | None = None
        self._commanded: list[float] | None = None

    @property
    def limit_violations(self) -> int:
        """Periods in which the arm was outside a limit, by its commands or as it moved."""
        return self.outside["commanded"] + self.outside["measured"]

    def _look_at_arm(self) -> None:
        """Judge the true joints by the arm's own limits: where they are, and how fast they were in any step of the
        period. Nothing is differentiated or rounded, and no tolerance is given. Commands are bound to a few percent
        less (``servo_overshoot`` of the table): periods with a joint over that bound are counted apart."""
        fastest = self.cell.fastest.tolist()
        share = max(map(truediv, fastest, self._fastest))
        self.measured_share = max(self.measured_share, share)
        self.outside["measured"] += share > 1.0 or self._beyond(self.cell.position.tolist())
        self.outside["over_command"] += any(map(gt, fastest, self._fastest_to_command))

    def _beyond(self, position: list[float]) -> bool:
        return not all(low <= at <= high for at, (low, high) in zip(position, self._range, strict=True))

    def step(self) -> None:
        """One FRI period; the limits are looked at in how the arm moved and in what it was told."""
        self.virtual.tick()
        self.silent = self.silent + DT if self.virtual.frozen else 0.0
        self._look_at_arm()
        self.report = report = self.virtual.report()
        if report["fri_period"] <= 0.0:
            return
        if "ptp" in self.loaded:
            self.ended.update((end["ptp_id"], end) for end in self.virtual.ptp_ends())
        commanded = np.asarray(report["commanded_position"]).tolist()
        outside = self._beyond(commanded)
        if self._commanded is not None and report["motion_allowed"]:
            speed = [abs(now - before) / DT for now, before in zip(commanded, self._commanded, strict=True)]
            self.peak_share = max(self.peak_share, *map(truediv, speed, self._fastest_to_command))
            outside = outside or any(
                v > most + FLOAT32 for v, most in zip(speed, self._fastest_to_command, strict=True)
            )
        self._commanded = commanded if report["motion_allowed"] else None
        self.outside["commanded"] += outside

    def palm(self) -> Pose:
        """Pose of the palm in the base frame, by the measured joints."""
        return Pose(*self.chain.fk(self.report["position"]))

    def look_at_motion(self) -> list[dict[str, Any]]:
        """Progress of the DMP and, while it moves, the newest set-point and goal."""
        self.progress = self.virtual.dmp_progress()
        records: list[dict[str, Any]] = self.virtual.ik_debug()
        if records:
            self.debug = records[-1]
        return records


class Job:
    """A task of the hand with its end: the verdict, None while it runs."""

    def __init__(self, task: Task, begun: float) -> None:
        self.task, self.begun = task, begun
        self.verdict: Verdict | None = None


class Hand(HandMemory):
    """Driver on the emulator over a line without a pty, as the hand's node uses it: one task at a time, polled at 30 Hz
    while it runs. ``dead``: nothing is polled and nothing told, as if that node were frozen."""

    def __init__(self, cell: Any) -> None:
        super().__init__(is_current=True, limit=TASK_LIMIT)
        self.cell = cell
        self.clock = SteppedClock()
        self.emulator = EmulatedHand(self.clock, physical=True)
        self.driver = HandSerialDriver(transport=VirtualLink(self.emulator, self.clock), clock=self.clock)
        self.message = ""
        self.reason = Reason.NONE
        self.job: Job | None = None
        self.positions: tuple[int, ...] = ()
        self.readings: Sequence[Any] = ()
        self.dead = False
        self._next_poll = 0.0
        self._calibrated_at = 0.0

    def begin(self, name: str, **fields: Any) -> Job:
        """Start a goal of one of the hand's actions; what runs ends. Raises what refuses it."""
        if self.job is not None:
            self.end(self.job, "replaced by a new goal; fingers stopped", Reason.SUPERSEDED)
        task = self.task_for(name, SimpleNamespace(**fields), self.driver)
        self.job = Job(task, self.clock.monotonic())
        task.begin(self.driver)
        return self.job

    def end(self, job: Job, text: str, reason: Reason) -> None:
        """End a goal before its time; the fingers stop. One that has ended stays as it is."""
        if job is self.job:
            self._over(Verdict(text, done=True, stop=True, reason=reason))

    def calibrate(self, mode: str) -> str | None:
        """Begin to calibrate; or why not. ``calibrating`` until it has ended."""
        words = mode.split()
        why = self.why_not_calibrate(words, self.job.task.name if self.job else None)
        if why is not None:
            self.reason, self.message = Reason.HAND_REFUSED, f"calibration refused: {why}"
            return why
        self.calibration_began()
        self.driver.calibration(words[0])  # at once in the emulator's time, which the world's has to catch up with
        self._calibrated_at = self.clock.monotonic()
        return None

    def calibration_over(self, t: float) -> bool:
        """Whether a calibration that was begun has ended by now."""
        if self.calibrating and t >= self._calibrated_at:
            self.calibrating, self.calibrated = False, True
        return not self.calibrating

    def step(self, t: float) -> None:
        """Follow the time and the motors that the physics turns; tell these what to do."""
        self.clock.now = max(self.clock.now, t)
        self.emulator.follow(
            [
                MotorState(motor["position"], motor["current"], motor["effort"], motor["moving"], motor["locked"])
                for motor in self.cell.motors()
            ]
        )
        self.emulator.advance()
        self.calibration_over(t)
        self._poll(t)
        self.cell.set_motors(*map(list, zip(*self.emulator.orders(), strict=True)))

    def _poll(self, t: float) -> None:
        if t < self._next_poll or self.dead or self.calibrating:
            return
        self._next_poll = t + (1 / 30 if self.job is not None else 0.2)
        readings = self.readings = [SimpleNamespace(**r) for r in self.driver.read_motors()]
        self.positions = tuple(r.position for r in readings)
        self.look(readings)
        if self.job is None:
            return
        elapsed = self.clock.monotonic() - self.job.begun
        verdict = self.job.task.judge(readings, elapsed)
        if verdict.done:
            self._over(verdict)
        elif elapsed > self.job.task.limit:
            text = f"not done within {self.job.task.limit:.0f} s; fingers stopped"
            self._over(Verdict(text, done=True, stop=True, reason=Reason.TIME_LIMIT))

    def _over(self, verdict: Verdict) -> None:
        job, self.job = self.job, None
        assert job is not None
        if verdict.stop:
            self.driver.stop_all()
        job.verdict = verdict
        self.task_over(job.task, verdict)
        self.reason, self.message = verdict.reason, f"{job.task.name}: {verdict.text}"


class World:
    """The simulated cell: robot, hand, an object, a person and a tracker, advanced by ``step()``.

    No ROS master, no threads, no real time: the same arguments give the same world, to the last bit. Example::

        world = World(seed=3, conditions=Conditions(object_id="bottle"))
        world.human.command("give bottle")
        for _ in range(round(2.0 / DT)):
            world.step()
        print(world.t, world.truth["held_by"], world.newest("human_hand"))

    Attributes: ``t`` (s, virtual time); ``truth``: the true state of the cell, a dict of SI units in the base frame;
    ``human``: the person (``command``, ``hear``, ``phase``); ``robot``: arm, controllers and limits; ``hand``: of the
    robot; ``cell``: the physics, for pushes and faults; ``sights``: newest Sight by frame; ``blind``: names of
    frames that the tracker does not see from now on; ``after_period``: functions that are called at the end of each
    period with a robot that is connected; ``seed`` and ``conditions``, as given.
    """

    def __init__(
        self,
        seed: int = 1,
        conditions: Conditions | None = None,
        object_on: str = "human_hand",
        turned: float = 0.0,
        limits: str = LIMITS,
        recording: Mapping[str, Any] | None = None,
    ) -> None:
        """
        ``seed``: of person, noise and tracker. ``conditions``: what person, tracker and object are like.
        ``object_on``: "human_hand", or "world" for the middle of the board. ``turned``: rad, by which the person holds
        the object turned about the vertical. ``limits``: path of the arm's table of joint limits. ``recording``: the
        person's hand goes as recorded; settings of coglab_sim.person.recorded_person.open_recorded_hand.

        ObjectError: no such object. RecordingError: the recording cannot be used. ValueError: a value out of range.
        """
        conditions = conditions or Conditions()
        self.seed, self.conditions = seed, conditions
        thing, _ = read_object(objects_folder() / f"{conditions.object_id}.yaml")
        self.object_frame = f"object_{conditions.object_id}"
        scene = Scene.of(thing, conditions.mass, conditions.friction)
        scene.object_turn = about_z(turned)
        participant = conditions.participant(seed)
        if recording is None:
            self.human = VirtualHuman(participant, scene, object_on == "human_hand")
        else:
            hand, way = open_recorded_hand(recording, self.object_frame)
            scene = scene_of(scene, hand)
            self.human = RecordedPerson(participant, scene, hand, way)
        self.scene = scene
        where = {
            **{f"object__{name}": value for name, value in cell_parameters(thing).items()},
            "object__mass": scene.object_mass,
            "object__friction": scene.object_friction,
            "object__start": object_on,
            "object__position": [float(v) for v in scene.object_in_hand],
            "object__rotation": [float(v) for v in scene.object_turn],
        }
        if object_on == "world":
            where["object__position"] = [float(v) for v in BOARD.apply([0.0, 0.0, 0.002])]
            where["object__rotation"] = [float(v) for v in BOARD.orientation]
        self.robot = Robot(seed, limits, **where)
        self.cell = self.robot.cell
        self.hand = Hand(self.cell)
        self.board = conditions.perception.calibration(seed) * BOARD
        """as the tracker sees it, which is off for the board as for everything"""
        self.trackers = {name: Tracker(name, conditions.perception, seed) for name in (self.object_frame, "human_hand")}
        self.after_period: list[Callable[[], None]] = []
        self.speed_scale = 1.0
        self.t = self.robot.virtual.now
        self.ticks = 0
        self.truth = self.cell.truth()
        self.sights: dict[str, Sight] = {}
        self.blind: set[str] = set()

    def newest(self, name: str) -> tuple[Pose | None, float]:
        """Newest sight of a frame and its age; the board stands where it was seen once."""
        if name == "board":
            return self.board, 0.0
        sight = self.sights.get(name)
        if sight is None:
            return None, OLDEST
        return sight.frame, self.t - sight.captured

    def step(self) -> None:
        """One FRI period, 5 ms."""
        if self.ticks % 2 == 0:
            self._person_and_tracker()
        self.hand.step(self.t)
        self.robot.virtual.set_frame("board", self.board.position, self.board.orientation)
        self.robot.step()
        self.ticks += 1
        self.t = self.robot.virtual.now
        if self.robot.report["fri_period"] > 0.0:
            for look in self.after_period:
                look()

    def _person_and_tracker(self) -> None:
        self.truth = truth = self.cell.truth()
        view = view_of(truth)
        move_person(self.cell, self.human.step(self.t, view))
        # The hand is where the arm has brought it, not where the person wants it.
        frames = {self.object_frame: view.object, "human_hand": pose_of_truth(truth["human_hand"])}
        for name, frame in frames.items():
            others = [other for each, other in frames.items() if each != name]
            for sight in self.trackers[name].step(self.t, frame, view.robot_hand, others):
                if name not in self.blind:
                    self.sights[name] = sight
                    self.robot.virtual.set_frame(
                        name, sight.frame.position, sight.frame.orientation, self.t - sight.captured
                    )
