"""The simulated cell in one process and in virtual time: robot (simulated KRC, bridge and controller manager; same
bytes as on the network, in lockstep), hand emulator behind the real driver, virtual human, tracker."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import coglab_controllers as cc
import numpy as np
import yaml
from coglab_objects.database import cell_parameters, objects_folder, read_object
from coglab_perception.sights import Sight
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z
from coglab_py.yaml_file import read
from coglab_sim.person.in_cell import move_person, seen_in
from coglab_sim.person.recorded_person import RecordedPerson, open_recorded_hand, scene_of
from coglab_sim.person.scene import Scene
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_sim.tracker.tracker import Tracker
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.physical_motor import MotorState
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.memory import HandMemory
from ih2_hand.progress import MotorVerdict, Task
from ih2_hand.reasons import Reason

from coglab_trials.conditions import Conditions

try:
    import coglab_sim._cell  # noqa: F401  (registers the type of LockstepRobot.cell)
    from coglab_sim._virtual import LockstepRobot
except ImportError as error:
    raise ImportError(
        f"the simulated cell cannot be loaded ({error}): its library is missing or was not built; "
        "run ./coglab build, which also installs Debian's libmujoco-dev"
    ) from error

LIMITS = str(package_path("lwr_description", "config", "joint_limits.yaml"))
BOARD = Pose(np.array([0.45, -0.55, 0.05]), about_z(-np.pi / 2))  # frame `board` in `world`, m
DT = 0.005  # s, FRI period
TASK_LIMIT = 8.0  # s, time limit of a preshape or a grasp
OLDEST = 1e9  # s, age of a frame that was never seen
PERSON_TOPIC = "person/human_hand"  # of the file of signals of the manager SafeDistance
DROPPED = 2  # number of worlds that may wait for Python's collector


def urdf_file() -> str:
    """Returns the path of the robot description."""
    return str(package_path("lwr_description", "urdf", "lwr_ih2.urdf"))


def manager_parameters(files: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Returns the parameters of /controller_manager as the launch file loads them. ``files``: their
    ``feedback_file``, ``signals_file``, ``central_file``; a name without a folder is in coglab_controllers/config."""
    config = package_path("coglab_controllers", "config")
    parameters: dict[str, Any] = read(config / "controllers.yaml").value
    for name, file in (files or {}).items():
        parameters[name] = file if "/" in file else str(config / (file if "." in file else f"{file}.yaml"))
    if parameters["feedback_file"].startswith("package://"):
        package, _, path = parameters["feedback_file"].removeprefix("package://").partition("/")
        parameters["feedback_file"] = str(package_path(package, path))
    return parameters


class Robot:
    """LockstepRobot with the measurements of each period that evaluation and detectors use.

    ``cell``: parameters of the simulated cell, with ``__`` for ``/`` in their names. ``limits``: file of joint limits.
    ``files``: see manager_parameters().
    """

    def __init__(self, seed: int, limits: str = LIMITS, files: Mapping[str, str] | None = None, **cell: Any) -> None:
        parameters = {
            "seed": int(seed),
            "krc/period": DT,
            "contact/board_center": list(BOARD.position),
            **{name.replace("__", "/"): value for name, value in cell.items()},
        }
        manager = manager_parameters(files)
        self.parameters = {**manager, "joint_limits_file": limits}
        self.virtual = LockstepRobot(urdf_file(), limits, parameters, yaml.safe_dump(manager))
        if files and self.virtual.start_errors:
            raise ValueError("; ".join(self.virtual.start_errors))
        self.cell = self.virtual.cell
        self.limits = cc.load_joint_limits(limits)
        with open(urdf_file(), encoding="utf-8") as stream:
            self.urdf = stream.read()
        self.chain = cc.Chain(self.urdf)
        self._report: dict[str, Any] | None = None
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
        self.silent = 0.0  # s since the robot's process has stopped (``virtual.frozen``)
        self.debug: dict[str, Any] | None = None

    @property
    def report(self) -> dict[str, Any]:
        """The control cycle's newest report, as LockstepRobot.report() returns it. Read once per period."""
        if self._report is None:
            self._report = self.virtual.report()
        return self._report

    def has_signal(self, topic: str) -> bool:
        """True if the file of signals has a row with this topic."""
        try:
            self.virtual.post_signal(topic, {}, age=OLDEST)
        except ValueError:
            return False
        return True

    @property
    def outside(self) -> dict[str, int]:
        """Numbers of periods outside a limit, without any tolerance but the rounding of commands to float32.
        ``commanded``: the commands. ``measured``: the true joints; their speed is the highest in any physics step.
        ``over_command``: a true joint above the limit of commands, which is a few percent lower than that of the arm
        (``servo_overshoot`` in the file of limits)."""
        limits = self.virtual.limits()
        return {name: limits[name] for name in ("commanded", "measured", "over_command")}

    @property
    def limit_violations(self) -> int:
        """Number of periods in which the commands or the true joints were outside a limit."""
        outside = self.outside
        return outside["commanded"] + outside["measured"]

    @property
    def peak_share(self) -> float:
        """Largest speed of the commands so far, as share of its limit."""
        return float(self.virtual.limits()["peak_share"])

    @property
    def measured_share(self) -> float:
        """Largest speed of the true joints so far, as share of the arm's limit."""
        return float(self.virtual.limits()["measured_share"])

    def step(self) -> None:
        """Run one FRI period. True joints and commands are checked against the limits."""
        self.virtual.tick()
        self._report = None
        self.silent = self.silent + DT if self.virtual.frozen else 0.0
        if "ptp" in self.loaded and self.virtual.connected:
            self.ended.update((end["ptp_id"], end) for end in self.virtual.ptp_ends())

    def palm(self) -> Pose:
        """Returns the pose of the palm in the base frame, from the measured joints."""
        return Pose(*self.chain.fk(self.report["position"]))

    def look_at_motion(self) -> list[dict[str, Any]]:
        """Read the progress of the DMP. Returns the new records of set-point and goal; empty while no motion runs."""
        self.progress = self.virtual.dmp_progress()
        records: list[dict[str, Any]] = self.virtual.ik_debug()
        if records:
            self.debug = records[-1]
        return records


class Job:
    """A task of the hand. ``verdict``: its result, None while it runs."""

    def __init__(self, task: Task, begun: float) -> None:
        self.task, self.begun = task, begun
        self.verdict: MotorVerdict | None = None


class Hand(HandMemory):
    """The real driver on the emulated hand, without a pty. As in the hand's node, one task runs at a time and is polled
    at 30 Hz. ``dead``: nothing is polled or reported, as if that node were frozen."""

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
        self._rested = False
        self._next_poll = 0.0
        self._calibrated_at = 0.0

    def begin(self, name: str, **fields: Any) -> Job:
        """Start a goal of one of the hand's actions. A running goal ends. Raises the error that refuses the goal."""
        self._follow()
        if self.job is not None:
            self.end(self.job, "replaced by a new goal; fingers stopped", Reason.SUPERSEDED)
        task = self.task_for(name, SimpleNamespace(**fields), self.driver)
        self.job = Job(task, self.clock.monotonic())
        task.begin(self.driver)
        return self.job

    def end(self, job: Job, text: str, reason: Reason) -> None:
        """End a goal early and stop the fingers. A goal that has already ended does not change."""
        if job is self.job:
            self._over(MotorVerdict(text, done=True, stop=True, reason=reason))

    def calibrate(self, mode: str) -> str | None:
        """Start a calibration; ``calibrating`` is True until it ends. Returns the reason if it is refused."""
        words = mode.split()
        why = self.why_not_calibrate(words, self.job.task.name if self.job else None)
        if why is not None:
            self.reason, self.message = Reason.HAND_REFUSED, f"calibration refused: {why}"
            return why
        self.calibration_began()
        self.driver.calibration(words[0])  # runs ahead on the emulator's clock; the world catches up
        self._calibrated_at = self.clock.monotonic()
        return None

    def calibration_over(self, t: float) -> bool:
        """True if no calibration is running at time ``t`` (s)."""
        if self.calibrating and t >= self._calibrated_at:
            self.calibrating, self.calibrated = False, True
        return not self.calibrating

    def step(self, t: float) -> None:
        """Advance to time ``t`` (s): read the simulated motors, poll the driver, set the motor commands."""
        self.clock.now = max(self.clock.now, t)
        rested, self._rested = self._rested, self.emulator.at_rest
        # While all motors are off, only a poll looks at them, and no order changes.
        if not (rested and self._rested) or t >= self._next_poll:
            self._follow()
        self.emulator.advance()
        self.calibration_over(t)
        self._poll(t)
        if not (rested and self._rested and self.emulator.at_rest):
            self.cell.set_motors(*map(list, zip(*self.emulator.orders(), strict=True)))

    def _follow(self) -> None:
        """Read the simulated motors."""
        self.emulator.follow([MotorState(*state) for state in self.cell.motor_states()])

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
            self._over(MotorVerdict(text, done=True, stop=True, reason=Reason.TIME_LIMIT))

    def _over(self, verdict: MotorVerdict) -> None:
        job, self.job = self.job, None
        assert job is not None
        if verdict.stop:
            self.driver.stop_all()
        job.verdict = verdict
        self.task_over(job.task, verdict)
        self.reason, self.message = verdict.reason, f"{job.task.name}: {verdict.text}"


class _Dropped:
    """Frees unused worlds early. Each holds several MB that Python does not count, so that its garbage collector would
    run too late."""

    def __init__(self) -> None:
        self._alive: weakref.WeakSet[Any] = weakref.WeakSet()
        self._enough = DROPPED

    def add(self, world: Any) -> None:
        """Count a new world. If many have become alive, collect those that are only alive in cycles."""
        if len(self._alive) >= self._enough:
            gc.collect()
            self._enough = len(self._alive) + DROPPED
        self._alive.add(world)


_DROPPED = _Dropped()


class World:
    """The simulated cell: robot, hand, object, person and tracker. ``step()`` advances it.

    No ROS master, no threads, no real time. The same arguments give the same world, bit for bit. Example::

        world = World(seed=3, conditions=Conditions(object_id="bottle"))
        world.human.command("give bottle")
        for _ in range(round(2.0 / DT)):
            world.step()
        print(world.t, world.truth["held_by"], world.newest("human_hand"))

    Attributes: ``t``: virtual time, s. ``truth``: true state of the cell, a dict in SI units and the base frame.
    ``human``: the person (``command``, ``hear``, ``phase``). ``robot``: arm, controllers and limits. ``hand``: the
    robot's hand. ``cell``: the physics, for pushes and faults. ``sights``: newest Sight by frame. ``blind``: names of
    frames that the tracker does not see; a test can change it. ``after_period``: functions that are called after each
    period with a connected robot. ``seed`` and ``conditions``: as given.
    """

    def __init__(
        self,
        seed: int = 1,
        conditions: Conditions | None = None,
        object_on: str = "human_hand",
        turned: float = 0.0,
        limits: str = LIMITS,
        recording: Mapping[str, Any] | None = None,
        files: Mapping[str, str] | None = None,
    ) -> None:
        """
        ``seed``: for person, noise and tracker. ``conditions``: properties of person, tracker and object.
        ``object_on``: "human_hand", or "world" for the middle of the board. ``turned``: rotation (rad) of the object in
        the person's hand about the vertical. ``limits``: path of the arm's joint limits. ``recording``: the person's
        hand follows a recording; settings of coglab_sim.person.recorded_person.open_recorded_hand. ``files``: of
        feedback controllers, signals and managers, see manager_parameters().

        ObjectError: unknown object. RecordingError: unusable recording. ValueError: a value is out of range.
        """
        _DROPPED.add(self)
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
        self.robot = Robot(seed, limits, files, **where)
        self.cell = self.robot.cell
        self.hand = Hand(self.cell)
        self.board = conditions.perception.calibration(seed) * BOARD
        """pose of the board as the tracker measures it, with the calibration error"""
        self._person_topic = self.robot.has_signal(PERSON_TOPIC)
        self.robot.virtual.set_fixed_frame("board", self.board.position, self.board.orientation)
        self.trackers = {name: Tracker(name, conditions.perception, seed) for name in (self.object_frame, "human_hand")}
        self.after_period: list[Callable[[], None]] = []
        self.speed_scale = 1.0
        self.t = self.robot.virtual.now
        self.ticks = 0
        self.sights: dict[str, Sight] = {}
        self.blind: set[str] = set()

    @property
    def truth(self) -> dict[str, Any]:
        """The true state of the cell, as Cell.truth() returns it."""
        truth: dict[str, Any] = self.cell.truth()
        return truth

    def newest(self, name: str) -> tuple[Pose | None, float]:
        """Returns the newest pose of a frame and its age (s). The board was seen once and does not move: age 0."""
        if name == "board":
            return self.board, 0.0
        sight = self.sights.get(name)
        if sight is None:
            return None, OLDEST
        return sight.frame, self.t - sight.captured

    def step(self) -> None:
        """Advance by one FRI period, 5 ms."""
        if self.ticks % 2 == 0:
            self._person_and_tracker()
        self.hand.step(self.t)
        self.robot.step()
        self.ticks += 1
        self.t = self.robot.virtual.now
        if self.robot.virtual.connected:
            for look in self.after_period:
                look()

    def _person_and_tracker(self) -> None:
        view, hand = seen_in(self.cell)
        move_person(self.cell, self.human.step(self.t, view))
        # Use the hand where the arm has moved it, not where the person wants it.
        for name, frame, other in ((self.object_frame, view.object, hand), ("human_hand", hand, view.object)):
            for sight in self.trackers[name].step(self.t, frame, view.robot_hand, (other,)):
                if name not in self.blind:
                    self.sights[name] = sight
                    self.robot.virtual.set_frame(
                        name, sight.frame.position, sight.frame.orientation, self.t - sight.captured
                    )
                    if name == "human_hand" and self._person_topic:
                        self._post_person(sight)

    def _post_person(self, sight: Sight) -> None:
        """Posts where the person is, as the node /person_points does. A sight that comes too late is refused."""
        place = {"position": list(sight.frame.position), "orientation": list(sight.frame.orientation)}
        age = self.t - sight.captured
        self.robot.virtual.post_signal(PERSON_TOPIC, place, age=age, frame="lwr_base_link")
