"""Reaches of the shipped DMP plug-in in the virtual world, with and without a push, as the robot measures them.

In a reach the arm stands at home, a hand moves into the handover region (minimum jerk, seen by the shipped tracker),
and the arm reaches for it with the shipped primitives, orientation and configuration. Without a push nothing touches
the arm. Drawn per seed:

* model errors of the robot controller and, independently, of the observer (payload +-10 %, inertia +-5 %);
* friction of the drives x 0.5 .. 1.5; offsets, bias and noise of the torque sensors;
* place, turn and time of the hand; duration x 0.8 .. 1.3 of the shipped one;
* in half of the reaches an object in the closed fingers. Its true mass is 0.7 .. 1.3 times the one in its file, which
  the observer uses.

A push is a force on the palm, across the path, in the physics: from 0 to ``NEWTON`` N in ``RISE`` s, then constant. It
begins in the last third of the path, at a uniformly drawn share of it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from coglab_objects.database import cell_parameters, objects_folder, read_object
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z
from coglab_sim.person.reach import Reach
from coglab_sim.tracker.tracker import PerceptionSettings, Tracker
from coglab_smach.kinematics.reachability import default_arm, solve
from coglab_trials.world import DT, Hand, Robot, urdf_file

LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))
OBJECTS = ("mug", "bottle", "ball", "screwdriver", "tea_box")
FRAME = "object_mug"
GRASP = Pose(np.array([0.0, -0.065, 0.07]), np.array([0.5, 0.5, 0.5, 0.5]))
"""pose of the palm in the goal frame: the mug's grasp, moved back by its approach distance"""
NEWTON = 3.0  # N, force of a push
RISE = 0.06  # s in which the force of a push rises
FOLLOWED = 0.40
"""s, recorded after the start of a push"""
AFTERWARDS = 0.3
"""s, recorded after the end of a reach without a push"""


@dataclass(frozen=True)
class Draw:
    """Drawn values of one reach."""

    place: np.ndarray
    turn: float
    from_where: np.ndarray
    hand_time: float
    start_share: float
    ratio: float
    friction: float
    held: str
    mass_share: float
    push_at: float
    angle: float

    @staticmethod
    def of(seed: int) -> Draw:
        """Returns the draw of this seed. The arm has a posture for its place."""
        rng = np.random.default_rng([seed, 53])
        while True:
            place = rng.uniform([0.70, -0.20, 0.25], [0.84, 0.20, 0.50])
            turn = float(rng.uniform(-0.35, 0.35))
            if solve(default_arm(), Pose(place, about_z(turn)) * GRASP) is not None:
                break
        return Draw(
            place,
            turn,
            rng.uniform([1.15, -0.3, 0.0], [1.35, 0.3, 0.3]),
            float(rng.uniform(0.9, 1.5)),
            float(rng.uniform(0.2, 1.0)),
            0.9 * float(rng.uniform(0.8, 1.3)),
            float(rng.uniform(0.5, 1.5)),
            str(rng.choice(OBJECTS)) if rng.random() < 0.5 else "",
            float(rng.uniform(0.7, 1.3)),
            float(rng.uniform(0.03, 1.0 / 3.0)),
            float(rng.uniform(0.0, 2.0 * np.pi)),
        )


@dataclass
class Recording:
    """Measurements of one reach, n samples, and the true values."""

    seed: int
    payload: tuple[float, np.ndarray]
    """(kg, m in ih2_palm) that the observer uses"""
    begun: float = 0.0
    """s, start of the motion"""
    reached: float | None = None
    one_newton: float | None = None
    """s, time from which the true force is at least 1 N"""
    stamp: list[float] = field(default_factory=list)
    position: list[np.ndarray] = field(default_factory=list)
    torque: list[np.ndarray] = field(default_factory=list)
    external: list[np.ndarray] = field(default_factory=list)
    velocity: list[np.ndarray] = field(default_factory=list)
    """as on lwr/joint_states"""
    touch: list[dict[str, np.ndarray]] = field(default_factory=list)
    """N, on phalanges and palm, without noise; empty if the push is a force on the palm itself"""
    hand: list[Any] = field(default_factory=list)
    """hand motors as polled at rest, 5 Hz; the same object until the next poll"""
    sight: list[tuple[float, Pose] | None] = field(default_factory=list)
    """(s, pose) of the newest sight of the target"""
    aborted: str = ""
    """reason of an early end; the record counts as a reach"""


@lru_cache(maxsize=1)
def urdf() -> str:
    """Text of the robot description."""
    with open(urdf_file(), encoding="utf-8") as stream:
        return stream.read()


def wrong_urdf(seed: int, payload_error: float = 0.10, inertia_error: float = 0.05) -> str:
    """Returns the robot description with drawn errors of the hand's mass and of the inertias."""
    rng = np.random.default_rng([seed, 59])
    robot = ElementTree.fromstring(urdf())
    hand = 1.0 + payload_error * rng.uniform(-1.0, 1.0)
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        of_hand = link.get("name", "").startswith("ih2")
        share = hand if of_hand else 1.0 + inertia_error * rng.uniform(-1.0, 1.0)
        if of_hand:
            for mass in inertial.findall("mass"):
                mass.set("value", repr(share * float(mass.get("value", "0"))))
        for inertia in inertial.findall("inertia"):
            for name, value in inertia.attrib.items():
                inertia.set(name, repr(share * float(value)))
    return ElementTree.tostring(robot, encoding="unicode")


class MovingReach:
    """Runs one reach. ``push``: ``across`` the line between robot and person, or none."""

    def __init__(self, seed: int, push: str = "") -> None:
        if push not in ("", "across"):
            raise ValueError(f"push is across or empty, got '{push}'")
        self.draw = draw = Draw.of(seed)
        self.push = push
        cell: dict[str, Any] = {"object__start": "world", "object__position": [0.45, -0.55, 0.052]}
        payload = (0.0, np.zeros(3))
        if draw.held:
            thing, _ = read_object(objects_folder() / f"{draw.held}.yaml")
            cell = {f"object__{name}": value for name, value in cell_parameters(thing).items()}
            cell["object__mass"] *= draw.mass_share
            cell.update(object__start="world", object__position=[0.45, -0.55, 0.052])
            self.in_palm = self._in_palm(thing)
            payload = (float(thing["mass"]), np.array([0.04, 0.0, 0.0]))
        friction = draw.friction * np.array([0.4, 0.4, 0.25, 0.25, 0.2, 0.1, 0.1])
        self.robot = Robot(seed, arm__coulomb_friction=[float(v) for v in friction], **cell)
        self.virtual, self.cell = self.robot.virtual, self.robot.cell
        self.tracker = Tracker(FRAME, PerceptionSettings(), seed)
        # The hand's driver and emulator, as the node has them: they read the motors, but turn none.
        self.motors = Hand(SimpleNamespace(motors=self.cell.motors, set_motors=lambda *orders: None))
        self.seen: tuple[float, Pose] | None = None
        self.record = Recording(seed, payload)
        self.hand: Reach | None = None

    @staticmethod
    def _in_palm(thing: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        """Pose of the object in the palm frame: its axis along y, its middle in front of the palm."""
        size = thing["size"]
        half = size[0 if thing["shape"]["type"] != "box" else 1] / 2
        turn = np.array([-0.5, -0.5, -0.5, 0.5])
        return np.array([half, 0.0, 0.0]) - Pose(np.zeros(3), turn).apply([0.0, 0.0, size[2] / 2]), turn

    def _grasp(self) -> None:
        """Take the preshape of a power grasp and close the fingers on the object, which nobody else holds."""
        self.cell.set_motors([1.0] * 5, [0.96, 0.02, 0.12, 0.20, 0.20], [240.0] * 5)
        self.run_for(1.0)
        self.cell.place("robot_hand", *self.in_palm)
        self.cell.set_motors([1.0] * 5, [0.96, 1.0, 1.0, 1.0, 1.0], [240.0] * 5)
        self.run_for(1.6)
        held = self.cell.truth()["object"]
        self.cell.place("world", held["position"], held["rotation"])

    @property
    def now(self) -> float:
        """s"""
        return float(self.virtual.now)

    def step(self) -> None:
        """Run one FRI period and record the measurements."""
        if self.hand is not None:
            place, _ = self.hand.at(self.now)
            for sight in self.tracker.step(self.now, Pose(place, about_z(self.draw.turn))):
                frame = sight.frame
                self.virtual.set_frame(FRAME, frame.position, frame.orientation, self.now - sight.captured)
                self.seen = sight.captured, frame
        self.robot.step()
        report, record = self.robot.report, self.record
        if report["fri_period"] <= 0.0:
            return
        record.stamp.append(self.now)
        for name, key in (
            ("position", "position"),
            ("torque", "torque"),
            ("external", "external_torque"),
            ("velocity", "measured_velocity"),
        ):
            getattr(record, name).append(np.array(report[key]))
        self.motors.step(self.now)
        record.hand.append(self.motors.readings)
        record.sight.append(self.seen)
        if not self.push:
            record.touch.append({name: np.array(force) for name, force in self.cell.touch().items()})

    def prepare(self) -> None:
        """Enter command mode, close the fingers on the object if there is one, load plug-ins, wait for rest."""
        virtual = self.virtual
        self._until(lambda: self.robot.report["fri_period"] > 0.0, 5.0)
        for event in ("position", "start"):
            ticket = virtual.submit(event)
            self._until(lambda ticket=ticket: virtual.outcome(ticket) is not None, 10.0)
        self._until(lambda: self.robot.report["motion_allowed"], 5.0)
        virtual.load_controller("dmp", "coglab/DmpController")
        virtual.load_dmps(LIBRARY)
        virtual.switch_controller("dmp")
        virtual.set_ik_debug(False)
        if self.draw.held:
            self._grasp()
        self.run_for(0.6)

    def run(self) -> Recording:
        """Run the whole reach. RuntimeError if it is refused or aborted, or if the hand loses its object."""
        draw, record = self.draw, self.record
        self.prepare()
        self.hand = Reach(draw.from_where, draw.place, self.now, draw.hand_time)
        self.run_for(max(0.2, draw.start_share * draw.hand_time))
        primitive = "give_human" if draw.held else "reach_human"
        goal = (primitive, draw.ratio, list(GRASP.position), True, list(GRASP.orientation), FRAME)
        # Like the machines, wait up to 1 s for a goal that the tracker has lost.
        end = self.now + 1.0
        while not (answer := self.virtual.execute_dmp(*goal))[0]:
            if self.now > end:
                raise RuntimeError(f"seed {record.seed}: the reach was refused: {answer[1]}")
            self.step()
        record.begun = self.now
        self._reach()
        if draw.held and self.cell.truth()["held_by"] != "robot":
            raise RuntimeError(f"seed {record.seed}: {draw.held} is held by {self.cell.truth()['held_by']}")
        return record

    def _reach(self) -> None:
        record, draw = self.record, self.draw
        end = self.now + 8.0
        palm, _ = default_arm().fk(self.robot.report["position"])
        whole = float(np.linalg.norm(palm - (Pose(draw.place, about_z(draw.turn)) * GRASP).position))
        while self.now < end:
            progress = self.virtual.dmp_progress()
            if progress["motion"] == "aborted":
                record.aborted = str(progress["reason"])
                break
            if progress["motion"] == "reached":
                record.reached = self.now
                break
            running = progress["motion"] == "running" and self.now > record.begun + 0.2
            if self.push and running and progress["remaining_distance"] < draw.push_at * whole:
                self._push()
                return
            self.step()
        self.run_for(AFTERWARDS)

    def _push(self) -> None:
        """Apply the force of the ramp at the end of this period."""
        line = self.draw.place * [1.0, 1.0, 0.0]
        aside = np.cross([0.0, 0.0, 1.0], line / np.linalg.norm(line))
        direction = np.cos(self.draw.angle) * aside + np.sin(self.draw.angle) * np.array([0.0, 0.0, 1.0])
        begin = self.now
        while self.now < begin + FOLLOWED:
            newton = NEWTON * min(1.0, (self.now + DT - begin) / RISE)
            if self.record.one_newton is None and newton >= 1.0 - 1e-9:
                self.record.one_newton = self.now
            self.cell.set_push(newton * direction)
            self.step()

    def run_for(self, seconds: float) -> None:
        """So long."""
        for _ in range(round(seconds / DT)):
            self.step()

    def _until(self, condition: Any, limit: float) -> None:
        end = self.now + limit
        while not condition():
            if self.now > end:
                raise RuntimeError(f"seed {self.record.seed}: the robot did not get ready within {limit} s")
            self.step()
