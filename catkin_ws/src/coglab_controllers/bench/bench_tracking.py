#!/usr/bin/python3
"""Tracking of random reaches at 200 Hz: the two-task IK beside plain whole-vector scaling and KDL's solvers.

An ideal velocity robot follows the commands; joints stop at their limits, and reaches that touch one are reported
apart. The same reaches are run through the bridge's interpolator as well.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass

import coglab_controllers as cc
import lockstep
import numpy as np
from core_bench import LIMITS, URDF, Row, minimum_jerk, row

try:
    import PyKDL
except ImportError:  # the peer is optional: its column is then null
    PyKDL = None

CYCLE, DURATION, REACHES, SEED = 0.005, 1.2, 300, 11
CYCLES = round(DURATION / CYCLE)
LOCKSTEP_REACHES = 300
REST = 100  # cycles that a reach is watched after its end
TIMES = np.linspace(0.0, DURATION, 241)
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
    """Worst and last errors of one reach (m, m, deg), largest joint speed over its limit, whether a joint touched its
    limit, and the time until the motion ended (s)."""

    worst: float
    last: float
    turned: float
    over: float
    stopped: bool
    duration: float


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Product of two quaternions x y z w."""
    v = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(v, p[3] * q[3] - p[:3] @ q[:3])


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
        target = multiply(cc.exp_rotation(turn), orientation)
        wrist = chain.joint_origins(posture)[5]
        # Where the wrist would be with the hand at the goal.
        local = rotate(conjugate(orientation), wrist - position)
        goal_wrist = goal + rotate(target, local)
        distances = [np.linalg.norm(w - shoulder) for w in (wrist, goal_wrist, 0.5 * (wrist + goal_wrist))]
        if min(distances) < 0.3 or max(distances) > 0.75 or min(position[2], goal[2]) < 0.05:
            continue
        reaches.append(Reach(posture, position, orientation, goal, target))
    return reaches


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverse of a unit quaternion."""
    return np.append(-q[:3], q[3])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A vector turned by a unit quaternion."""
    return multiply(multiply(q, np.append(v, 0.0)), conjugate(q))[:3]


# Joint velocity for posture, reference and last joint velocity, and the share that the speed limits let pass.
Solver = Callable[[np.ndarray, cc.CartesianReference, np.ndarray], tuple[np.ndarray, float]]


def two_task(chain: cc.Chain, limits: cc.JointLimits, rotation_first: bool, ahead: bool = False) -> Solver:
    """Our IK; `ahead`: with the Jacobian of the middle of the cycle."""
    ik = cc.TwoTaskIk(GAIN, GAIN, rotation_first_scaling=rotation_first, velocity_limit=limits.velocity)

    def solve(q: np.ndarray, reference: cc.CartesianReference, last: np.ndarray) -> tuple[np.ndarray, float]:
        result = ik.solve(chain, q, reference, velocity=last, dt=CYCLE if ahead else 0.0)
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


def kdl_solver(chain: cc.Chain, limits: cc.JointLimits, kind: str) -> Solver:
    """KDL's 6x7 velocity solvers with the same closed loop and whole-vector scaling."""
    tree = kdl_chain()
    if kind == "wdls":
        solver = PyKDL.ChainIkSolverVel_wdls(tree)
        solver.setLambda(0.05)
    else:
        solver = PyKDL.ChainIkSolverVel_pinv(tree)
    joints, velocity = PyKDL.JntArray(7), PyKDL.JntArray(7)

    # The solver only refers to the chain, which must therefore live as long.
    def solve(
        q: np.ndarray, reference: cc.CartesianReference, _: np.ndarray, keep: object = tree
    ) -> tuple[np.ndarray, float]:
        position, orientation = chain.fk(q)
        linear = reference.velocity + GAIN * (reference.position - position)
        angular = reference.angular_velocity + GAIN * cc.rotation_between(orientation, reference.orientation)
        for i in range(7):
            joints[i] = q[i]
        solver.CartToJnt(joints, PyKDL.Twist(PyKDL.Vector(*linear), PyKDL.Vector(*angular)), velocity)
        result = np.array([velocity[i] for i in range(7)])
        return result / max(1.0, float(np.max(np.abs(result) / limits.velocity))), 1.0

    return solve


def angle_between(p: np.ndarray, q: np.ndarray) -> float:
    """Angle between two orientations, deg."""
    return float(np.degrees(np.linalg.norm(cc.rotation_between(p, q))))


def run(
    chain: cc.Chain,
    limits: cc.JointLimits,
    reach: Reach,
    primitive: cc.Primitive,
    solve: Solver,
    waits: bool,
    interpolated: bool = False,
) -> Outcome:
    """One reach on an ideal velocity robot, or through the interpolator.

    `waits`: the clock of the motion slows where limits slow the arm, as in the control cycle; else it runs on.
    """
    motion, governor = cc.CartesianMotion(), cc.PhaseGovernor()
    motion.start(primitive, reach.position, reach.orientation, reach.goal, reach.target)
    interpolator = cc.Interpolator(limits)
    interpolator.reset(reach.posture)
    q, velocity, scale, cycles, rest = reach.posture.copy(), np.zeros(7), 1.0, 0, 0
    outcome = Outcome(0.0, 0.0, 0.0, 0.0, False, 0.0)
    while rest < REST and cycles < 4 * CYCLES:
        rate = governor.update(CYCLE, 1.0, scale if waits else 1.0)
        reference = motion.step(CYCLE, reach.goal, reach.target, rate)
        position, _ = chain.fk(q)
        outcome.worst = max(outcome.worst, float(np.linalg.norm(position - reference.position)))
        velocity, scale = solve(q, reference, velocity)
        outcome.over = max(outcome.over, float(np.max(np.abs(velocity) / limits.velocity)))
        if interpolated:
            q = interpolator.step(velocity, CYCLE)
            outcome.over = max(outcome.over, float(np.max(np.abs(interpolator.velocity) / limits.velocity)))
        else:
            q = q + CYCLE * velocity
        clipped = np.clip(q, limits.lower_position, limits.upper_position)
        outcome.stopped = outcome.stopped or bool(np.any(clipped != q))
        q = q if interpolated else clipped
        cycles += 1
        if motion.phase == "ended":
            rest += 1
        else:
            outcome.duration = cycles * CYCLE
    position, orientation = chain.fk(q)
    outcome.last = float(np.linalg.norm(position - reach.goal))
    outcome.turned = angle_between(orientation, reach.target)
    return outcome


def rows_of(
    name: str, outcomes: list[Outcome], peer: str | None, peer_outcomes: list[Outcome] | None, gated: bool
) -> list[Row]:
    """Position and orientation errors over the reaches without a joint at its stop."""

    def figures(chosen: list[Outcome] | None) -> list[float | None]:
        if chosen is None:
            return [None] * 4
        free = [o for o in chosen if not o.stopped]
        worst = 1000.0 * np.array([o.worst for o in free])
        turned = np.array([o.turned for o in free])
        return [
            float(np.percentile(worst, 95)),
            float(worst.max()),
            100.0 * float(np.mean(turned > 3.0)),
            float(sum(o.stopped for o in chosen)),
        ]

    ours, theirs = figures(outcomes), figures(peer_outcomes)
    return [
        row(
            "tracking",
            f"{name}: position error, 95th percentile",
            ours[0],
            "mm",
            "<= 0.3" if gated else "",
            peer,
            theirs[0],
            below_peer=gated,
        ),
        row(
            "tracking",
            f"{name}: position error, largest",
            ours[1],
            "mm",
            "<= 1" if gated else "",
            peer,
            theirs[1],
            below_peer=gated,
        ),
        row("tracking", f"{name}: reaches more than 3 deg off at the end", ours[2], "%", "", peer, theirs[2]),
        row(
            "tracking",
            f"{name}: reaches of {len(outcomes)} that touched a joint limit",
            ours[3],
            "1",
            "",
            peer,
            theirs[3],
        ),
    ]


def lockstep_rows(limits: cc.JointLimits, reaches: list[Reach]) -> list[Row]:
    """The reaches without a joint at its stop through the whole robot in virtual time; nothing if it is not built."""
    if lockstep._virtual is None:
        return []
    outcomes = [lockstep.reach(r.posture, r.goal, r.target, limits.velocity) for r in reaches[:LOCKSTEP_REACHES]]
    done = [o for o in outcomes if not isinstance(o, str)]
    for refused in (o for o in outcomes if isinstance(o, str)):
        print(refused, file=sys.stderr)
    last = 1000.0 * np.array([o.last for o in done])
    return [
        row(
            "tracking",
            f"bridge and stand-in in lockstep, {len(done)} reaches: position at the end, 95th percentile",
            np.percentile(last, 95),
            "mm",
            "<= 1",
        ),
        row("tracking", "bridge and stand-in in lockstep: position at the end, median", np.median(last), "mm", ""),
        row("tracking", "bridge and stand-in in lockstep: position at the end, largest", last.max(), "mm", ""),
        row(
            "tracking",
            "bridge and stand-in in lockstep: until the arm stands, median",
            np.median([o.duration for o in done]),
            "s",
            "",
        ),
        row(
            "tracking",
            "bridge and stand-in in lockstep: reaches refused or aborted, a joint or the workspace in the way",
            len(outcomes) - len(done),
            "1",
            "",
        ),
        row(
            "tracking",
            "bridge and stand-in in lockstep: largest joint speed sent over its limit",
            max(o.over for o in done),
            "1",
            "<= 1.000001",
        ),
        row(
            "tracking",
            "bridge and stand-in in lockstep: the same of the simulated arm behind its servos",
            max(o.arm_over for o in done),
            "1",
            "",
        ),
    ]


def main() -> None:
    """Prints the rows as JSON."""
    chain, limits = cc.Chain(URDF.read_text()), cc.load_joint_limits(str(LIMITS))
    primitive = cc.learn(
        "reach", [(TIMES, np.outer(minimum_jerk(TIMES / DURATION), [0.5, 0.0, 0.0]))], mapping="similarity"
    )
    reaches = draw_reaches(chain, limits)

    def all_of(solver: Solver, waits: bool, interpolated: bool = False) -> list[Outcome]:
        return [run(chain, limits, reach, primitive, solver, waits, interpolated) for reach in reaches]

    ours = all_of(two_task(chain, limits, True, ahead=True), waits=True)
    hurried = all_of(two_task(chain, limits, True), waits=False)
    plain = all_of(two_task(chain, limits, False), waits=False)
    wdls = all_of(kdl_solver(chain, limits, "wdls"), waits=False) if PyKDL else None
    through = all_of(two_task(chain, limits, True, ahead=True), waits=True, interpolated=True)
    free = [o for o in ours if not o.stopped]
    slowed = 100.0 * float(np.mean([o.duration > min(x.duration for x in free) + 0.05 for o in free]))
    ends = 1000.0 * np.array([o.last for o in through if not o.stopped])
    touched = [o.stopped for o in ours]
    over = max(o.over for o in ours + hurried + plain + through)
    rows = rows_of("rotation shrunk first", ours, "KDL wdls" if PyKDL else None, wdls, gated=True)
    rows += [
        row(
            "tracking",
            "rotation shrunk first: reaches slowed by more than 50 ms because translation alone met a limit",
            slowed,
            "%",
            "",
        ),
        row("tracking", "rotation shrunk first: longest reach", max(o.duration for o in free), "s", ""),
    ]
    rows += rows_of(
        "rotation shrunk first, clock not slowed", hurried, "KDL wdls" if PyKDL else None, wdls, gated=False
    )
    rows += rows_of("whole vector scaled (plain D4.10)", plain, "KDL wdls" if PyKDL else None, wdls, gated=False)
    rows += [
        row(
            "tracking",
            "through the interpolator: position at the end, 95th percentile",
            np.percentile(ends, 95),
            "mm",
            "<= 1",
        ),
        row("tracking", "largest joint speed over its limit, all runs", over, "1", "<= 1.000000001"),
    ]
    rows += lockstep_rows(limits, [r for r, stop in zip(reaches, touched, strict=True) if not stop])
    json.dump(rows, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
