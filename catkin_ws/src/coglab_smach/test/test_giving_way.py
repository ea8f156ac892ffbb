"""The palm follows a person who pulls at the object while the hand closes or has closed."""

import numpy as np
import pytest
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.states.hand_tracking import palm_axis
from coglab_smach.states.yield_to_pull import YieldToPull
from conftest import Trial

RECEIVE = "exchange_human_to_robot"
ASIDE = np.array([0.0, 1.0, 0.0])


def palm(trial):
    return default_arm().fk(np.asarray(trial.ctx.arm.joint_positions()))[0]


def pull(trial, force, seconds):
    """Pull sideways with ``force`` N for ``seconds``."""
    trial.cell.pulled = tuple(force * ASIDE)
    trial.clock.sleep(seconds)
    trial.cell.pulled = (0.0, 0.0, 0.0)


def receiving(script, let_go_after=0.2, **overrides):
    """Receive; run ``script`` from the start of closing. Returns the trial when a hub is open again."""
    trial = Trial(**overrides)
    trial.cell.partner.let_go_after = let_go_after

    def walk(t):
        t.begin()
        t.until(lambda: t.ctx.journal.marked("closing"))
        t.cell.calls.clear()
        script(t)
        t.until(t.ctx.requests.hub)

    return trial.run(walk)


def until_weight(t):
    t.until(lambda: "arm lift" in t.cell.called())
    t.clock.sleep(0.15)


def motions(trial):
    """Beginnings and ends of motions, in order."""
    return [name for name in trial.cell.called() if name in ("move_ptp", "cancel")]


def test_the_palm_follows_a_pull_while_the_fingers_close():
    gone = []

    def script(t):
        begin = palm(t)
        pull(t, 12.0, 0.3)
        gone.append(float((palm(t) - begin) @ ASIDE))

    trial = receiving(script)
    assert trial.result().outcome == "succeeded" and "gave_way" in trial.result().marks
    assert 0.01 < gone[0] < 0.055


def test_the_palm_follows_a_pull_during_the_lift_and_motions_do_not_overlap():
    gone, height = [], []

    def script(t):
        until_weight(t)
        begin = palm(t)
        pull(t, 10.0, 1.0)
        gone.append(float((palm(t) - begin) @ ASIDE))
        t.clock.sleep(0.3)
        height.append(float(palm(t)[2] - begin[2]))
        t.cell.let_go()

    trial = receiving(script, let_go_after=None)
    assert 0.03 < gone[0] < 0.055, "as far as pull.way allows"
    assert height[0] > 0.015, "the rise continues after the pull"
    assert trial.result().outcome == "succeeded" and "gave_way" in trial.result().marks
    order = motions(trial)
    assert order[:3] == ["move_ptp", "cancel", "move_ptp"], order


def test_a_short_jolt_is_no_pull():
    def script(t):
        until_weight(t)
        pull(t, 20.0, 0.02)
        t.wait_hub("wait_with_object")

    assert "gave_way" not in receiving(script).result().marks


@pytest.mark.parametrize("weight", [-9.0, 9.0])
def test_a_vertical_force_is_no_pull(weight):
    trial = Trial()
    trial.cell.pulled = (4.0, 3.0, weight)
    pull = YieldToPull(trial.ctx).pull()
    assert pull[2] == 0.0 and np.linalg.norm(pull) <= 5.0


def test_a_press_into_the_palm_is_no_pull():
    trial = Trial()
    outward = palm_axis(trial.ctx)
    trial.cell.pulled = tuple(-12.0 * outward)
    assert np.linalg.norm(YieldToPull(trial.ctx).pull()) < 1e-6
    trial.cell.pulled = tuple(12.0 * outward)
    assert np.linalg.norm(YieldToPull(trial.ctx).pull()) == pytest.approx(12.0 * np.linalg.norm(outward[:2]))


def test_the_palm_does_not_yield_without_a_measured_force():
    def script(t):
        t.cell.pulled = None
        t.wait_hub("wait_with_object")

    assert "gave_way" not in receiving(script).result().marks
