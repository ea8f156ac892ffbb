"""Who pulls at what the robot's hand closes on is given way to: the palm goes along, fingers loosen."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.states.yielding import GivesWay
from conftest import Trial

RECEIVE = "exchange_human_to_robot"
ASIDE = np.array([0.0, 1.0, 0.0])


def palm(trial):
    return default_arm().fk(np.asarray(trial.ctx.arm.joint_positions()))[0]


def pull(trial, force, seconds):
    """Sideways with so many N, for so long."""
    trial.cell.pulled = tuple(force * ASIDE)
    trial.clock.sleep(seconds)
    trial.cell.pulled = (0.0, 0.0, 0.0)


def receiving(script, let_go_after=0.2, **overrides):
    """Receive; ``script`` when the fingers begin to close. The trial, once a hub is open again."""
    trial = Trial(**overrides)
    trial.cell.partner.let_go_after = let_go_after

    def walk(t):
        t.wait_hub("wait_without_object")
        t.start(RECEIVE)
        while not t.ctx.journal.marked("closing"):
            t.clock.sleep(0.01)
        t.cell.calls.clear()
        script(t)
        while t.ctx.requests.hub() == "":
            t.clock.sleep(0.05)

    return trial.run(walk)


def until_weight(t):
    while "arm lift" not in t.cell.called():
        t.clock.sleep(0.01)
    t.clock.sleep(0.15)


def motions(trial):
    """Beginnings and ends of motions, in order."""
    return [name for name in trial.cell.called() if name in ("move_ptp", "cancel")]


def test_closing_fingers_loosen_while_somebody_pulls_and_close_again():
    def script(t):
        t.clock.sleep(0.2)
        pull(t, 12.0, 0.4)
        assert "open" in t.cell.called() and t.ctx.shared

    trial = receiving(script)
    assert trial.result().outcome == "succeeded" and "pulled" in trial.result().marks
    calls = trial.cell.called()
    assert "close" in calls[calls.index("open") :]


def test_who_pulls_again_and_again_while_the_hand_closes_has_it_back():
    def script(t):
        t.cell.pulled = tuple(12.0 * ASIDE)
        t.wait_hub("wait_without_object")

    trial = receiving(script)
    result = trial.result()
    assert result.outcome == "failed_empty" and result.code == ReasonCode.NOT_RELEASED
    assert "pulled at 'mug' again and again while the hand closed" in trial.ctx.journal.why()
    assert trial.ctx.holding == "" and not trial.ctx.shared


def test_the_palm_goes_along_while_the_arm_takes_the_weight_and_every_motion_ends_before_the_next():
    gone = []

    def script(t):
        until_weight(t)
        begin = palm(t)
        pull(t, 8.0, 1.0)
        gone.append(float((palm(t) - begin) @ ASIDE))
        t.clock.sleep(0.3)
        t.cell.let_go()

    trial = receiving(script, let_go_after=None)
    assert 0.03 < gone[0] < 0.055, "as far as pull.way lets it"
    assert trial.result().outcome == "succeeded" and "gave_way" in trial.result().marks
    order = motions(trial)
    assert order[:3] == ["move_ptp", "cancel", "move_ptp"], order


def test_who_pulls_hard_while_the_arm_takes_the_weight_has_it_back_at_once():
    def script(t):
        until_weight(t)
        pull(t, 14.0, 0.4)

    trial = receiving(script, let_go_after=None)
    result = trial.result()
    assert result.outcome == "failed_empty" and result.code == ReasonCode.NOT_RELEASED
    assert "the person pulled at 'mug' and has it back" in trial.ctx.journal.why()


@pytest.mark.parametrize(
    "force, expected", [((0, 0, -3.0), 0.0), ((0, 0, 3.0), 0.0), ((0, 0, -9.0), 5.96), ((4, 3, 0), 5.0)]
)
def test_what_the_object_weighs_is_no_pull(force, expected):
    trial = Trial()
    trial.cell.pulled = force
    assert GivesWay(trial.ctx, 0.31).strength() == pytest.approx(expected, abs=0.01)


def test_nothing_is_given_way_to_where_the_detector_does_not_tell():
    def script(t):
        t.cell.pulled = None
        t.wait_hub("wait_with_object")

    assert "gave_way" not in receiving(script).result().marks
