"""The random reaches through bridge, controller manager and the stand-in for the robot controller, in lockstep.

Needs the robot in virtual time of coglab_sim; without it the figures are missed.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import yaml
from core_bench import LIMITS, PACKAGE, PRIMITIVES, URDF

try:
    from coglab_sim import _cell, _virtual  # noqa: F401  (_cell knows the types that _virtual uses)
except ImportError:  # optional: the simulated cell is a package of its own
    _virtual = None

FEEDBACK = PACKAGE.parent / "ctrl_more" / "config" / "feedback.yaml"
PERIOD, FRAME_PERIOD = 0.005, 0.03
START_LIMIT, REACH_LIMIT, WATCHED = 10.0, 6.0, 1.5  # s of simulated time


@dataclass
class LockstepReach:
    """One reach. Distance of the hand from its goal at the end as the simulated arm has it (m, deg), largest distance
    from the reference as measured (m), time until it stood (s). Largest of the joints over their limits: speed and
    acceleration of the set-point that the bridge sends, and of the arm behind its servos (its true joint state at the
    end of every period, also while it comes to rest, and for as long after it was aborted or given up as after it was
    reached); rad by which a joint of the arm was beyond its range, negative inside. `why`: it was refused or given up.
    `feedback`: how many feedback controllers ran, the fewest and the most at any sight of its goal."""

    begun: bool
    why: str
    last: float
    turned: float
    off_path: float = 0.0
    duration: float = 0.0
    over: float = 0.0
    acceleration: float = 0.0
    arm_over: float = 0.0
    arm_acceleration: float = 0.0
    arm_beyond: float = -np.inf
    feedback: tuple[int, int] = (0, 0)


def wait(robot, condition, limit: float) -> None:
    """Advances until the condition holds; raises TimeoutError after `limit` s of simulated time."""
    end = robot.now + limit
    while not condition():
        if robot.now > end:
            raise TimeoutError(f"the simulated robot did not get ready within {limit} s")
        robot.advance(PERIOD)


def must(answer: tuple) -> None:
    """Raises what a service refused."""
    if not answer[0]:
        raise RuntimeError(answer[1])


def ready(posture: np.ndarray, manager: str = ""):
    """The whole robot in virtual time, standing in a posture in command mode, with the DMP plug-in active.

    `manager`: YAML text of the controller manager's parameters.
    """
    cell = {"krc/period": PERIOD, "seed": 1, "home": [float(q) for q in posture]}
    robot = _virtual.LockstepRobot(str(URDF), str(LIMITS), cell, manager)
    must(robot.load_controller("dmp", "coglab/DmpController"))
    must(robot.load_dmps(str(PRIMITIVES)))
    wait(robot, lambda: robot.cell.quality == 3, START_LIMIT)
    ticket = robot.submit("start")
    outcomes: list[tuple] = []  # an outcome is told once
    wait(robot, lambda: (o := robot.outcome(ticket)) is not None and not outcomes.append(o), START_LIMIT)
    must(outcomes[0])
    must(robot.switch_controller("dmp"))
    return robot


def as_shipped() -> str:
    """The controller manager's shipped parameters, with the shipped list of feedback controllers, whose profile for
    reaches enables none."""
    text = (PACKAGE / "config" / "controllers.yaml").read_text()
    return re.sub(r"package://(\w+)", lambda found: str(PACKAGE.parent / found.group(1)), text)


def listed() -> int:
    """How many feedback controllers the shipped list has."""
    return len(yaml.safe_load(FEEDBACK.read_text())["loadControllers"])


def with_feedback(folder: Path) -> str:
    """The same, but that reaches have all controllers of the shipped list, in its order: a list file of one's own, as
    an experimenter would write it, in that folder."""
    text = as_shipped()
    if str(FEEDBACK) not in text:
        raise ValueError(f"the shipped parameters were expected to name {FEEDBACK}")
    shipped = yaml.safe_load(FEEDBACK.read_text())
    shipped |= {"searchPath": [str(FEEDBACK.parent)], "profiles": {"dmp": shipped["loadControllers"]}}
    file = folder / "feedback.yaml"
    file.write_text(yaml.safe_dump(shipped))
    return text.replace(str(FEEDBACK), str(file))


class Watch:
    """What one reach does, tick by tick."""

    def __init__(self, robot, limits, outcome: LockstepReach) -> None:
        self.robot, self.limits, self.outcome = robot, limits, outcome
        self.before = robot.report()["commanded_position"]
        self.velocity, self.arm_velocity = np.zeros(7), np.array(robot.cell.velocity)
        self.hands: list[tuple[float, np.ndarray]] = []
        self.stood: float | None = None

    def look(self) -> dict:
        """Takes one tick into account; the report of the control cycle."""
        robot, limits, outcome = self.robot, self.limits, self.outcome
        report = robot.report()
        set_point = report["commanded_position"]
        velocity = (set_point - self.before) / PERIOD
        outcome.over = max(outcome.over, float(np.max(np.abs(velocity) / limits.velocity)))
        change = np.abs(velocity - self.velocity) / PERIOD
        outcome.acceleration = max(outcome.acceleration, float(np.max(change / limits.acceleration)))
        self.before, self.velocity = set_point, velocity
        speed = self.look_at_arm(np.array(robot.cell.position), np.array(robot.cell.velocity))
        self.stood = (self.stood or robot.now) if speed < 1e-3 else None
        for record in robot.ik_debug():
            off = float(np.linalg.norm(record["set_point"][0] - record["measured"][0]))
            outcome.off_path = max(outcome.off_path, off)
        return report

    def look_at_arm(self, position: np.ndarray, velocity: np.ndarray) -> float:
        """Takes the true state of the joints after one period into account; their largest speed over its limit."""
        limits, outcome = self.limits, self.outcome
        beyond = np.maximum(position - limits.upper_position, limits.lower_position - position)
        outcome.arm_beyond = max(outcome.arm_beyond, float(np.max(beyond)))
        change = np.abs(velocity - self.arm_velocity) / PERIOD
        outcome.arm_acceleration = max(outcome.arm_acceleration, float(np.max(change / limits.acceleration)))
        self.arm_velocity = velocity
        speed = float(np.max(np.abs(velocity) / limits.velocity))
        outcome.arm_over = max(outcome.arm_over, speed)
        return speed


def reach(
    posture: np.ndarray, goal: np.ndarray, target: np.ndarray, limits: cc.JointLimits, manager: str
) -> LockstepReach:
    """One DMP motion from rest in a posture to a goal frame that stays. `manager`: parameters of the controller manager
    as YAML text, as_shipped() or with_feedback()."""
    robot = ready(posture, manager)
    robot.set_frame("goal", goal, target)
    answer = robot.execute_dmp(
        "reach_human", orientation_control=True, target_orientation=[0.0, 0.0, 0.0, 1.0], goal_frame="goal"
    )
    outcome = LockstepReach(bool(answer[0]), "" if answer[0] else answer[1], 0.0, 0.0)
    if outcome.begun:
        robot.set_ik_debug(True)
        follow(robot, goal, target, limits, outcome)
    hand = robot.cell.truth()["robot_hand"]
    outcome.last = float(np.linalg.norm(hand["position"] - goal))
    outcome.turned = float(np.degrees(np.linalg.norm(cc.rotation_between(hand["rotation"], target))))
    return outcome


def follow(robot, goal: np.ndarray, target: np.ndarray, limits: cc.JointLimits, outcome: LockstepReach) -> None:
    """Runs a reach until it has been over for WATCHED s, however it ended: the arm brakes after an abort, too."""
    begin, ended, watch = robot.now, None, Watch(robot, limits, outcome)
    running: list[int] = []
    while ended is None or robot.now - ended < WATCHED:
        robot.set_frame("goal", goal, target)
        for _ in range(round(FRAME_PERIOD / PERIOD)):
            robot.tick()
            report = watch.look()
        running.append(sum(c["activity"] == "running" for c in robot.feedback_status()["controllers"]))
        if report["motion"] == "aborted" and not outcome.why:
            outcome.why, ended = report["reason"], robot.now
        elif report["motion"] == "reached" and ended is None:
            ended = robot.now
        elif ended is None and robot.now - begin > REACH_LIMIT:
            outcome.why, ended = report["reason"] or "the motion waits at a border of the workspace", robot.now
    outcome.feedback = min(running), max(running)
    outcome.duration = (watch.stood or robot.now) - begin
