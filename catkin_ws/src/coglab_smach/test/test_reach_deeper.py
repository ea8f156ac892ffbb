"""A hand at its goal without contact moves deeper along the grasp's approach axis, once."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from conftest import Trial


def receive(touch_after, refuse="", **settings):
    """Receive with a touch after ``touch_after`` s (None: never). Returns the trial and the requests of the reach."""
    trial = Trial(**settings)
    trial.cell.partner.touch_after = touch_after
    asked, execute = [], trial.ctx.arm.execute_dmp

    def kept(request):
        asked.append(request)
        if len(asked) > 1 and refuse:
            trial.cell.faults.refuse["execute_dmp"] = refuse
        return execute(request)

    trial.ctx.arm.execute_dmp = kept

    def script(t):
        t.begin()
        t.clock.sleep(1.0)
        t.wait_hub("wait_with_object" if touch_after is not None else "wait_without_object")

    trial.run(script)
    return trial, asked


def test_the_hand_goes_deeper_once_by_the_configured_distance():
    trial, asked = receive(4.0)
    assert trial.result().outcome == "succeeded"
    assert len(asked) == 2
    way = np.subtract(asked[1].goal_offset, asked[0].goal_offset)
    axis = np.array(asked[0].goal_approach)
    assert np.linalg.norm(way) == pytest.approx(trial.ctx.config.get("handover.deeper"))
    assert way @ axis == pytest.approx(np.linalg.norm(way) * np.linalg.norm(axis)), "along the axis, inward"
    assert asked[1].arrival_speed == asked[0].arrival_speed > 0.0
    assert np.allclose(asked[1].goal_approach, 0.0) and asked[1].goal_region_low == asked[0].goal_region_low
    marks = trial.result().marks
    assert marks["went_on"] - marks["motion_reached"] >= trial.ctx.config.get("handover.feel") - 1e-6


def test_the_hand_does_not_go_deeper_after_an_early_touch():
    trial, asked = receive(0.2)
    assert trial.result().outcome == "succeeded" and len(asked) == 1


def test_without_any_contact_the_action_fails():
    trial, asked = receive(None)
    assert trial.result().code == ReasonCode.NO_CONTACT and len(asked) == 2


def test_an_arm_that_is_refused_to_go_deeper_waits():
    trial, asked = receive(4.0, refuse="the goal is 0.3 s old")
    assert trial.result().outcome == "succeeded" and len(asked) == 2
    assert "went_on" not in trial.result().marks
