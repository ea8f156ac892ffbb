"""Who pushes, hides or lets go of what the arm is for: nothing that is withdrawn is followed, nothing is dropped."""

from dataclasses import replace

import numpy as np
import pytest
import smach
from coglab_msgs.msg import ReasonCode
from coglab_trials.trial import VirtualTrial

RECEIVE = "exchange_human_to_robot"


@pytest.fixture(autouse=True)
def quiet():
    """The engine's log helps nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)


def receiving(there_before):
    """A script: one exchange, of an object that is offered with it, or has been ``there_before``."""

    def script(t):
        t.wait_hub("wait_without_object")
        if there_before:
            t.rig.human.command("give mug")
            while t.rig.human.phase != "waiting":
                t.clock.sleep(0.05)
        before, end = len(t.ctx.journal.results), t.clock.now() + 60.0
        t.ctx.requests.submit(RECEIVE, "mug")
        t.begun.append(RECEIVE)
        while len(t.ctx.journal.results) == before and t.clock.now() < end:
            t.clock.sleep(0.05)

    return script


@pytest.mark.parametrize("timing", ["calm", "natural"])
@pytest.mark.parametrize("there_before", [False, True])
def test_who_pushes_the_arm_and_goes_is_not_chased(timing, there_before):
    """40 N for a second; as the arm draws back, the person takes the object away. What the arm then begins anew toward
    was in the region before, whether the reach had begun on a belief or on a sight."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True, timing=timing)
    pushed, gone, toward = [], [], []

    def beside(t):
        if not pushed and t._reach is not None and t.rig.t > t._reach.begin + 0.3:
            pushed.append(t.rig.t)
        if pushed:
            t.rig.cell.set_push([-40.0 if t.rig.t < pushed[0] + 1.0 else 0.0, 0.0, 0.0])
        if pushed and not gone and t.ctx.journal.marked("bumped"):
            gone.append(t.rig.t)
            t.rig.human.command("rest")
        if gone and t.rig.t > gone[0] + 0.7:
            truth, chain = t.rig.cell.truth(), t.rig.robot.chain
            way = np.asarray(truth["human_hand"]["position"]) - np.asarray(truth["robot_hand"]["position"])
            velocity = chain.jacobian(truth["position"])[:3] @ truth["velocity"]
            toward.append(float(velocity @ way / np.linalg.norm(way)))

    trial.beside = beside
    result = trial.run(script=receiving(there_before))[0]
    assert gone and result.outcome == "failed_empty" and result.reason, trial.ctx.journal.why()
    assert result.code in {ReasonCode.GOAL_WITHDRAWN, ReasonCode.GOAL_LEFT_REGION, ReasonCode.GOAL_AHEAD_OUTSIDE}
    assert max(toward) < 0.05


@pytest.mark.parametrize("when", ["closed", "loaded"])
def test_a_hand_that_stays_and_does_not_hold_gets_nothing_back(when):
    """Before or after the weight has come the person lets go, but leaves the hand at the object: it would fall."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True, behaviour="never_release")
    done = []

    def beside(t):
        if not done and t.begun and t.ctx.journal.marked(when):
            done.append(t.rig.human.step)
            t.rig.human.step = lambda now, view: replace(done[0](now, view), grip=0.0, grip_force=0.0)

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    truth = trial.rig.cell.truth()
    assert done and not truth["dropped"] and truth["held_by"] in ("robot", "both"), trial.ctx.journal.why()
    assert result.outcome == "failed_holding" and result.code == ReasonCode.NOT_RELEASED


def test_what_is_hidden_as_the_hand_takes_it_back_ends_the_reach():
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    gone = []

    def beside(t):
        if not gone and t._reach is not None and t.rig.t > t._reach.begin + 0.15:
            gone.append(t.rig.t)
            t.rig.blind.add("object_mug")
            t.rig.human.command("rest")

    trial.beside = beside
    result = trial.run(script=receiving(True))[0]
    assert gone and result.outcome == "failed_empty" and result.reason, trial.ctx.journal.why()
    assert result.code in {ReasonCode.GOAL_WITHDRAWN, ReasonCode.GOAL_LOST}, result.reason
