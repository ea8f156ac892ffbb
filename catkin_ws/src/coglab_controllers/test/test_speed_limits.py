"""Cartesian speed limits, checked on the simulated arm of the whole robot in virtual time."""

from __future__ import annotations

from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
DESCRIPTION = PACKAGE.parent / "lwr_description"
URDF, LIMITS = DESCRIPTION / "urdf" / "lwr_ih2.urdf", DESCRIPTION / "config" / "joint_limits.yaml"
PERIOD = 0.005  # s
HOME = np.array([-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782])
LIMIT, ELBOW = 0.25, 3


def must(answer: tuple) -> None:
    assert answer[0], answer[1]


def ready():
    """The whole robot in virtual time, standing in command mode, with the DMP plug-in active."""
    virtual = pytest.importorskip("coglab_sim._virtual")  # the simulated cell is a package of its own
    manager = f"{{hand_speed_limit: {LIMIT}, elbow_speed_limit: {LIMIT}}}"
    robot = virtual.LockstepRobot(
        str(URDF), str(LIMITS), {"krc/period": PERIOD, "seed": 1, "home": HOME.tolist()}, manager
    )
    must(robot.load_controller("dmp", "coglab/DmpController"))
    must(robot.load_dmps(str(PACKAGE / "config" / "primitives.xml")))

    def wait(condition):
        while not condition():
            assert robot.now < 10.0, "the simulated robot does not get ready"
            robot.advance(PERIOD)

    wait(lambda: robot.cell.quality == 3)
    ticket = robot.submit("start")
    outcomes: list[tuple] = []  # an outcome is told once
    wait(lambda: (outcome := robot.outcome(ticket)) is not None and not outcomes.append(outcome))
    must(outcomes[0])
    must(robot.switch_controller("dmp"))
    return robot


def fastest(robot, chain: cc.Chain, seconds: float) -> tuple[float, float]:
    """Largest speeds of hand and elbow of the simulated arm, m/s."""
    hand, elbow = 0.0, 0.0
    for _ in range(round(seconds / PERIOD)):
        robot.set_frame("goal", [0.80, 0.0, 0.45])
        robot.tick()
        truth = robot.cell.truth()
        q, velocity = np.asarray(truth["position"]), np.asarray(truth["velocity"])
        hand = max(hand, float(np.linalg.norm(chain.jacobian(q)[:3] @ velocity)))
        ahead = chain.joint_origins(q + 1e-6 * velocity)[ELBOW] - chain.joint_origins(q)[ELBOW]
        elbow = max(elbow, float(np.linalg.norm(ahead)) / 1e-6)
    return hand, elbow


@pytest.mark.parametrize("ratio", [0.4, 0.7, 1.0])
def test_a_reach_keeps_the_limits_of_the_real_arm(chain: cc.Chain, ratio: float) -> None:
    robot = ready()
    robot.set_frame("goal", [0.80, 0.0, 0.45])
    answer = robot.execute_dmp("reach_human", dmp_ratio=ratio, goal_frame="goal")
    assert answer[0], answer[1]
    hand, elbow = fastest(robot, chain, 4.0)
    assert max(hand, elbow) <= LIMIT
    assert hand > 0.75 * LIMIT, "the limit was reached, or this shows nothing"
    assert robot.report()["motion"] == "reached"


def test_a_point_to_point_motion_keeps_them_too(chain: cc.Chain) -> None:
    robot = ready()
    must(robot.load_controller("ptp", "coglab/PtpController"))
    must(robot.switch_controller("ptp"))
    target = HOME + np.array([0.8, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0])
    status, _, message = robot.add_ptp(list(target), [1.5] * 7)
    assert status == 0, message
    hand, elbow = fastest(robot, chain, 6.0)
    assert max(hand, elbow) <= LIMIT
    assert hand > 0.75 * LIMIT
    assert np.abs(robot.report()["position"] - target).max() < 3e-3
