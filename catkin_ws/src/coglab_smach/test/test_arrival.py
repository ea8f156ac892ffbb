"""After a point-to-point motion the brain checks the measured joints; the controller's report is not enough."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from conftest import Trial

JOINT = 3


def take_with(aside):
    """Run take. At the board, joint 3 is measured ``aside(seconds since the motion's end)`` rad beside its target.
    Returns the trial and the time (s) from the motion's end to the state's end."""
    trial = Trial()
    arm, board = trial.ctx.arm, trial.ctx.config.get("postures.board")
    real, ended, looked = arm.joint_positions, [], []

    def positions():
        place = real()
        if place is None or np.max(np.abs(np.subtract(place, board))) > 1e-3:
            return place
        if not ended:
            ended.append(trial.clock.now())
        looked.append(trial.clock.now() - ended[0])
        place = list(place)
        place[JOINT] += aside(looked[-1])
        return tuple(place)

    arm.joint_positions = positions

    def script(t):
        t.begin("take")
        t.wait_hub("wait_with_object" if abs(aside(10.0)) < 0.03 else "wait_without_object")

    trial.run(script)
    assert ended, "it never came to the board"
    return trial


@pytest.mark.parametrize("size", [0.031, 0.1, -0.1])
def test_an_arm_beside_its_target_has_not_arrived(size):
    trial = take_with(lambda t: size)
    result = trial.result()
    assert result.outcome == "failed_empty"
    assert "'board'" in result.reason and "0.03" in result.reason
    assert result.code == ReasonCode.TIME_LIMIT
    assert not trial.cell.called("close"), "the hand must not close there"


def test_an_arm_that_settles_within_a_second_has_arrived():
    assert take_with(lambda t: 0.1 if t < 0.8 else 0.0).result().outcome == "succeeded"


def test_an_arm_within_the_tolerance_has_arrived():
    assert take_with(lambda t: 0.029).result().outcome == "succeeded"
