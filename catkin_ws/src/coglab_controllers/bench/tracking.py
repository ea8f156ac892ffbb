"""Random reaches at 200 Hz on an ideal velocity robot whose joints stop at their limits, for several ways from a pose
to joint velocities. All are slowed by the same clock where a limit slows the arm, and all use the Jacobian of the
middle of the cycle: what differs is the priority rule alone.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass

import coglab_controllers as cc
import numpy as np
from core_bench import URDF
from scipy.spatial.transform import Rotation

try:
    import PyKDL
except ImportError:  # the peer is optional: its column is then null
    PyKDL = None

CYCLE, DURATION, REACHES, SEED = 0.005, 1.2, 300, 11
CYCLES = round(DURATION / CYCLE)
REST = 100  # cycles that a reach is watched after its end
GAIN = 20.0


@dataclass
class Reach:
    """Start posture (7,), hand's place and orientation there, goal (3,) and target orientation (4,)."""

    posture: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    goal: np.ndarray
    target: np.ndarray


@dataclass
class Outcome:
    """Largest distance from the path (m), errors at the end (m, deg), largest joint speed over its limit, whether a
    joint came to its stop, and the time until the motion ended (s)."""

    worst: float
    last: float
    turned: float
    over: float
    stopped: bool
    duration: float


def draw_reaches(chain: cc.Chain, limits: cc.JointLimits) -> list[Reach]:
    """Random reaches of 0.3 to 0.6 m with a turn of up to 60 deg that stay within the arm's length."""
    rng = np.random.default_rng(SEED)
    shoulder = chain.joint_origins(np.zeros(7))[1]
    reaches: list[Reach] = []
    while len(reaches) < REACHES:
        posture = rng.uniform(0.75 * limits.lower_position, 0.75 * limits.upper_position)
        position, orientation = chain.fk(posture)
        way = rng.normal(size=3)
        goal = position + way / np.linalg.norm(way) * rng.uniform(0.3, 0.6)
        axis = rng.normal(size=3)
        turn = axis / np.linalg.norm(axis) * rng.uniform(0.0, np.radians(60.0))
        before = Rotation.from_quat(orientation)
        after = Rotation.from_quat(cc.exp_rotation(turn)) * before
        wrist = chain.joint_origins(posture)[5]
        # Where the wrist would be with the hand at the goal.
        goal_wrist = goal + after.apply(before.inv().apply(wrist - position))
        distances = [np.linalg.norm(w - shoulder) for w in (wrist, goal_wrist, 0.5 * (wrist + goal_wrist))]
        if min(distances) < 0.3 or max(distances) > 0.75 or min(position[2], goal[2]) < 0.05:
            continue
        reaches.append(Reach(posture, position, orientation, goal, after.as_quat()))
    return reaches


# Joint velocity for posture, reference and last joint velocity, and the share that the speed limits let pass.
Solver = Callable[[np.ndarray, cc.CartesianReference, np.ndarray], tuple[np.ndarray, float]]


def two_task(chain: cc.Chain, limits: cc.JointLimits, rotation_first: bool) -> Solver:
    """Our IK; `rotation_first`: the rotation is shrunk before the whole vector is scaled."""
    ik = cc.TwoTaskIk(GAIN, GAIN, rotation_first_scaling=rotation_first, velocity_limit=limits.velocity)

    def solve(q: np.ndarray, reference: cc.CartesianReference, last: np.ndarray) -> tuple[np.ndarray, float]:
        result = ik.solve(chain, q, reference, velocity=last, dt=CYCLE)
        return result.velocity, result.scale

    return solve


def kdl_chain() -> "PyKDL.Chain":
    """The robot as KDL's Python binding needs it, read from the URDF."""
    joints = {j.find("child").get("link"): j for j in ElementTree.parse(URDF).getroot().iter("joint")}
    link, path = "ih2_palm", []
    while link != "lwr_base_link":
        path.append(joints[link])
        link = joints[link].find("parent").get("link")
    chain = PyKDL.Chain()
    for joint in reversed(path):
        origin = joint.find("origin")
        xyz = PyKDL.Vector(*map(float, origin.get("xyz").split()))
        frame = PyKDL.Frame(PyKDL.Rotation.RPY(*map(float, origin.get("rpy").split())), xyz)
        if joint.get("type") == "fixed":
            chain.addSegment(PyKDL.Segment(PyKDL.Joint(), frame))
            continue
        axis = frame.M * PyKDL.Vector(*map(float, joint.find("axis").get("xyz").split()))
        chain.addSegment(PyKDL.Segment(PyKDL.Joint(joint.get("name"), frame.p, axis, PyKDL.Joint.RotAxis), frame))
    return chain


def kdl_solver(chain: cc.Chain, limits: cc.JointLimits, kind: str, setting: float) -> Solver:
    """KDL's 6x7 velocity solvers with the same closed loop and whole-vector scaling.

    `setting`: damping of wdls, or threshold of the singular values of pinv.
    """
    tree = kdl_chain()
    if kind == "wdls":
        solver = PyKDL.ChainIkSolverVel_wdls(tree)
        solver.setLambda(setting)
    else:
        solver = PyKDL.ChainIkSolverVel_pinv(tree, setting)
    joints, velocity = PyKDL.JntArray(7), PyKDL.JntArray(7)

    # The solver only refers to the chain, which must therefore live as long.
    def solve(
        q: np.ndarray, reference: cc.CartesianReference, last: np.ndarray, keep: object = tree
    ) -> tuple[np.ndarray, float]:
        position, orientation = chain.fk(q)
        linear = reference.velocity + GAIN * (reference.position - position)
        angular = reference.angular_velocity + GAIN * cc.rotation_between(orientation, reference.orientation)
        middle = q + 0.5 * CYCLE * last
        for i in range(7):
            joints[i] = middle[i]
        solver.CartToJnt(joints, PyKDL.Twist(PyKDL.Vector(*linear), PyKDL.Vector(*angular)), velocity)
        result = np.array([velocity[i] for i in range(7)])
        scale = 1.0 / max(1.0, float(np.max(np.abs(result) / limits.velocity)))
        return scale * result, scale

    return solve


def angle_between(p: np.ndarray, q: np.ndarray) -> float:
    """Angle between two orientations, deg."""
    return float(np.degrees(np.linalg.norm(cc.rotation_between(p, q))))


def run(chain: cc.Chain, limits: cc.JointLimits, reach: Reach, primitive: cc.Primitive, solve: Solver) -> Outcome:
    """One reach on an ideal velocity robot; the clock of the motion slows where limits slow the arm."""
    motion, governor = cc.CartesianMotion(), cc.PhaseGovernor()
    motion.start(primitive, reach.position, reach.orientation, reach.goal, reach.target)
    q, velocity, scale, cycles, rest = reach.posture.copy(), np.zeros(7), 1.0, 0, 0
    outcome = Outcome(0.0, 0.0, 0.0, 0.0, False, 0.0)
    while rest < REST and cycles < 4 * CYCLES:
        rate = governor.update(CYCLE, 1.0, scale)
        reference = motion.step(CYCLE, reach.goal, reach.target, rate)
        position, _ = chain.fk(q)
        outcome.worst = max(outcome.worst, float(np.linalg.norm(position - reference.position)))
        velocity, scale = solve(q, reference, velocity)
        outcome.over = max(outcome.over, float(np.max(np.abs(velocity) / limits.velocity)))
        wanted = q + CYCLE * velocity
        q = np.clip(wanted, limits.lower_position, limits.upper_position)
        outcome.stopped = outcome.stopped or bool(np.any(q != wanted))
        cycles += 1
        if motion.phase == "ended":
            rest += 1
        else:
            outcome.duration = cycles * CYCLE
    position, orientation = chain.fk(q)
    outcome.last = float(np.linalg.norm(position - reach.goal))
    outcome.turned = angle_between(orientation, reach.target)
    return outcome
