"""Motions and feedback controllers in Python inside the cycle of the virtual robot."""

from __future__ import annotations

import coglab
import numpy as np
import pytest
from coglab.control import Motion, Reference
from scipy.spatial.transform import Rotation


class Circle(Motion):
    """The palm draws a circle across its pointing direction, from rest to rest."""

    def configure(self, setup):
        self.radius = setup.argument("radius", "m", 0.05, 0.0, 0.15)
        self.duration = setup.argument("duration", "s", 3.0, 1.0, 60.0)

    def start(self, start):
        self.begin, self.turn = start.set_point.position, start.set_point.orientation
        self.r, self.all, self.time = start.arguments[self.radius], start.arguments[self.duration], 0.0

    def place(self, time):
        u = min(time / self.all, 1.0)
        angle = 2 * np.pi * u**3 * (10 - 15 * u + 6 * u * u)
        way = np.array([0.0, self.r * np.sin(angle), self.r * (1 - np.cos(angle))])
        return self.begin + Rotation.from_quat(self.turn).apply(way)

    def reference(self, cycle):
        self.time = cycle.next
        now, then = self.place(cycle.time), self.place(cycle.next)
        velocity = (then - now) / (cycle.next - cycle.time)
        return Reference(position=now, orientation=self.turn, twist=[*velocity, 0, 0, 0])

    def done(self):
        return self.time >= self.all


@pytest.fixture
def world():
    with coglab.World(seed=1, person="patient") as world:
        yield world


def palm_path(world):
    """Positions of the palm (m) in each period from now on."""
    path = []
    world.after_period.append(lambda w: path.append(w.cell.robot.palm().position))
    return path


def test_the_palm_follows_a_python_motion(world):
    world.add_motion("circle", Circle())
    path = palm_path(world)
    assert world.run_motion("circle", radius=0.06, duration=4.0).ok
    path = np.array(path)
    across = np.linalg.norm(path - path[0], axis=1).max()
    assert across == pytest.approx(0.12, abs=0.005)
    assert np.linalg.norm(path[-1] - path[0]) < 0.005
    assert world.cell.robot.virtual.limits()["commanded"] == 0


class Turn(Circle):
    """The last joint turns at once by 0.5 rad."""

    def reference(self, cycle):
        super().reference(cycle)
        joints = np.array(self.joints)
        joints[6] += 0.5 if cycle.time > 0.5 else 0.0
        return Reference(joints=joints)

    def start(self, start):
        super().start(start)
        self.joints = start.set_point.joints


def test_a_motion_ends_when_the_arm_has_arrived_too(world):
    world.add_motion("turn", Turn())
    before = world.robot.state.joints[6]
    assert world.run_motion("turn", duration=1.0).ok
    assert world.robot.state.joints[6] - before == pytest.approx(0.5, abs=0.005)


class Wrong(Circle):
    """A circle that does something wrong after half a second."""

    def __init__(self, reference):
        self.wrong = reference

    def reference(self, cycle):
        return super().reference(cycle) if cycle.time < 0.5 else self.wrong()


class Far(Circle):
    """Starts away from the set-point."""

    def place(self, time):
        return super().place(time) + [0.1, 0.0, 0.0]


def raises():
    raise KeyError("my mistake")


@pytest.mark.parametrize(
    ("motion", "named"),
    [
        (Wrong(raises), "my mistake"),
        (Wrong(lambda: Reference(joints=[0.0] * 6)), "(7,)"),
        (Wrong(lambda: Reference(joints=[np.nan] * 7)), "finite"),
        (Wrong(lambda: Reference(position=[0, 0, 1], orientation=[0, 0, 0, 2])), "length 1"),
        (Wrong(lambda: [0.0] * 7), "Reference"),
        (Far(), "set-point"),
    ],
    ids=["exception", "shape", "nan", "quaternion", "type", "begin"],
)
def test_a_faulty_motion_is_aborted_and_the_arm_brakes(world, motion, named):
    world.add_motion("mine", motion)
    end = world.run_motion("mine")
    assert not end.ok and end.reason == "CONTROLLER_FAULT" and named in end.causes[0] and "\n" not in end.causes[0]
    world.step(1.0)
    robot = world.cell.robot.virtual
    assert robot.report()["standing"] and robot.limits()["commanded"] == 0


def test_limits_hold_for_a_motion_that_is_too_fast(world):
    world.add_motion("circle", Circle())
    world.run_motion("circle", radius=0.15, duration=1.0)
    assert world.cell.robot.virtual.limits()["commanded"] == 0


def test_a_motion_that_does_not_end_is_stopped_at_its_limit(world):
    world.add_motion("circle", Circle())
    with pytest.raises(TimeoutError, match="circle"):
        world.run_motion("circle", duration=5.0, limit=1.0)
    assert world.robot.state.standing


def test_invalid_requests_are_refused_with_a_reason(world):
    world.add_motion("circle", Circle())
    with pytest.raises(coglab.Refused, match="in use"):
        world.add_motion("circle", Circle())
    with pytest.raises(coglab.Refused, match="speed"):
        world.run_motion("circle", speed=1.0)
    with pytest.raises(coglab.Refused, match="radius"):
        world.run_motion("circle", radius=3.0)
    with pytest.raises(ValueError, match="add_motion"):
        world.run_motion("nobody")
    with pytest.raises(ValueError, match="radius"):
        world.run_motion("circle", radius="large")
    for wrong in (Circle, 3):
        with pytest.raises(ValueError, match="coglab.control.Motion"):
            world.add_motion("other", wrong)


CONTROLLER = """
import ctrl_more


class Aside(ctrl_more.FeedbackController):
    # Moves the palm 2 cm along y.

    def describe(self):
        d = ctrl_more.Description("moves the palm aside")
        d.modifies("taskSpaceReferencePose", "ee", size=7, limit=ctrl_more.CorrectionLimit(size=0.05))
        return d

    def initialize(self, setup):
        self.pose = setup.modify("ee")

    def update(self, cycle, robot, original, modified):
        modified[self.pose][1] += 0.02
"""


def test_a_python_controller_is_loaded_into_the_cycle_of_the_robot(world, tmp_path):
    (tmp_path / "aside.py").write_text(CONTROLLER)
    (tmp_path / "list.yaml").write_text("loadControllers: [aside]\naside: {type: 'aside:Aside', enabled: false}\n")
    manager = world.feedback
    manager.load(str(tmp_path / "list.yaml"))
    world.step(0.5)
    before = world.cell.robot.palm().position
    manager.enable("aside")
    world.step(3.0)
    moved = world.cell.robot.palm().position - before
    assert moved[1] == pytest.approx(0.02, abs=0.004)
