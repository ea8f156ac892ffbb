"""Bad input against the real controller manager, bridge and hand driver: the sentences are theirs."""

from dataclasses import replace

import numpy as np
import pytest
import smach
from coglab_msgs.msg import ReasonCode, Say
from coglab_trials.trial import VirtualTrial
from hand_orders import HandOrders

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"


@pytest.fixture(autouse=True)
def quiet():
    """The engine's log helps nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)


def at_home(trial):
    home = np.array(trial.ctx.config.get("postures.home"))
    return np.max(np.abs(np.asarray(trial.rig.robot.report["position"]) - home)) < 0.03


def blinded(after, **overrides):
    """Receive; perception loses the object ``after`` s into the motion."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True, **overrides)

    def beside(t):
        if t._reach is not None and t.rig.t > t._reach.begin + after:
            t.rig.blind.add("object_mug")

    trial.beside = beside
    return trial, trial.run(RECEIVE)


def test_goal_lost_half_way():
    trial, results = blinded(0.3, **{"handover.reach_ratio": 4.0})
    assert results[0].outcome == "failed_empty" and trial.last_hub == "wait_without_object" and at_home(trial)
    why = trial.ctx.journal.why()
    assert why.startswith("wait_stop: the reach was aborted, because the goal is lost for 1") and "m to go" in why


def test_goal_lost_for_the_rest_of_a_short_way_is_finished_on_the_held_one():
    trial, results = blinded(0.5)
    assert results[0].outcome == "succeeded", trial.ctx.journal.why()


def test_primitive_that_does_not_exist():
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    entry = trial.ctx.database.database.get("mug")
    broken = {**entry, "dmp": {**entry["dmp"], "receive": "reach_the_moon"}}
    trial.ctx.database.database.get = lambda object_id: broken
    results = trial.run(RECEIVE)
    assert results[0].outcome == "failed_empty" and trial.last_hub == "wait_without_object" and at_home(trial)
    why = trial.ctx.journal.why()
    assert why.startswith("execute_dmp: ") and "reach_the_moon" in why


def test_hand_dead_when_the_object_comes():
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)

    def beside(t):
        t.rig.hand.dead = t.rig.hand.dead or (t._reach is not None)

    trial.beside = beside
    results = trial.run(RECEIVE)
    assert results[0].outcome == "failed_empty" and at_home(trial)
    assert "preshape 'cylindrical'" in results[0].reason or "closing of the hand" in results[0].reason


def test_command_mode_lost_in_mid_reach_and_reset():
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    done = []

    def beside(t):
        if t._reach is not None and t.rig.t > t._reach.begin + 0.4 and not done:
            done.append(t.rig.t)
            t.rig.cell.leave_command_mode("cut by the test")

    def script(t):
        t.wait_hub("wait_without_object")
        t.ctx.requests.submit(RECEIVE, "mug")
        t.wait_hub("stopped")
        assert t.ctx.journal.why() == (
            "wait_stop: the reach was aborted, because the robot stopped the motion: the "
            "robot controller is in monitor mode; send start"
        )
        assert t.ctx.requests.submit("reset", "")[0]
        t.wait_hub("wait_without_object")

    trial.beside = beside
    trial.run(script=script)
    assert done and trial.ctx.journal.results[-1].outcome == "stopped"
    assert trial.last_hub == "wait_without_object" and at_home(trial)
    assert trial.rig.robot.limit_violations == 0


def lets_go_of_it(trial):
    """The fingers open by themselves: a finger that slips off, a hand that somebody has switched off."""
    for motor in range(1, 5):
        trial.rig.hand.driver.move_motor(motor, 511, False)


def test_stop_while_the_hand_opens_and_the_person_takes_the_object():
    """The fingers stay as STOP has left them and say that they hold something. Where the object is seen with the person
    the hand is empty all the same, and the next exchange is theirs to begin."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    pressed = []

    def beside(t):
        last = t.ctx.journal.transitions[-1] if t.ctx.journal.transitions else None
        if not pressed and last is not None and last.to_state == "hand_open":
            pressed.append(t.rig.t)
            t.ctx.stop.press("the test")

    def script(t):
        t.wait_hub("wait_without_object")
        t.ctx.requests.submit(RECEIVE, "mug")
        t.wait_hub("wait_with_object")
        t.ctx.requests.submit(GIVE, "mug")
        t.wait_hub("stopped")
        while t.rig.cell.truth()["held_by"] != "human" or t.rig.human.phase != "idle":
            t.clock.sleep(0.05)
        assert t.ctx.hand.state().holding, "else this test shows nothing"
        assert t.ctx.requests.submit("reset", "")[0]
        t.wait_hub("wait_without_object")
        assert not t.ctx.hand.state().holding and t.ctx.holding == ""

    trial.beside = beside
    trial.run(script=script)
    assert pressed and at_home(trial) and not trial.rig.cell.truth()["dropped"]


def test_an_object_that_leaves_the_hand_on_the_way_home():
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    done = []

    def beside(t):
        if not done and any(move.from_state == "take_weight" for move in t.ctx.journal.transitions):
            done.append(lets_go_of_it(t))

    trial.beside = beside
    results = trial.run(RECEIVE)
    assert done and trial.rig.cell.truth()["dropped"]
    assert results[0].outcome == "failed_empty" and results[0].code == ReasonCode.OBJECT_NOT_SEEN
    assert trial.last_hub == "wait_without_object" and at_home(trial) and trial.ctx.holding == ""
    assert "'mug' has left the hand on the way" in trial.ctx.journal.why()


def test_an_object_that_leaves_the_hand_on_the_way_to_the_person():
    """The arm does not go on to the person, and nobody is told that they have it."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    done = []

    def beside(t):
        if not done and t.begun[-1:] == [GIVE] and t._reach is not None and t.rig.t > t._reach.begin + 0.3:
            done.append(lets_go_of_it(t))

    trial.beside = beside
    results = trial.run(RECEIVE, GIVE)
    assert done and trial.rig.cell.truth()["dropped"]
    assert results[1].outcome == "failed_empty" and results[1].code == ReasonCode.OBJECT_NOT_SEEN
    assert trial.last_hub == "wait_without_object" and at_home(trial) and trial.ctx.holding == ""
    assert "'mug' has left the hand on the way" in trial.ctx.journal.why()
    assert Say.YOU_HAVE_IT not in [code for _, code in trial.said]


def test_a_partner_who_pushes_the_arm_away_while_it_gives():
    """60 N for a second: the arm holds on to the object and gives it to the person who waits for it."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    pushed = []

    def beside(t):
        if not pushed and t.begun[-1:] == [GIVE] and t._reach is not None and t.rig.t > t._reach.begin + 0.8:
            pushed.append(t.rig.t)
        if pushed:
            t.rig.cell.set_push([-60.0 if t.rig.t < pushed[0] + 1.0 else 0.0, 0.0, 0.0])

    trial.beside = beside
    results = trial.run(RECEIVE, GIVE)
    truth = trial.rig.cell.truth()
    assert pushed and results[1].outcome == "succeeded", trial.ctx.journal.why()
    assert truth["held_by"] == "human" and not truth["dropped"]
    assert trial.rig.robot.limit_violations == 0


@pytest.mark.parametrize("after, outcomes", [(0.3, ["succeeded"]), (0.8, ["succeeded", "failed_empty"])])
def test_a_partner_who_pushes_the_arm_away_while_it_receives(after, outcomes):
    """40 N for a second. On the way that is no object in the hand: the arm draws back, comes again and takes it. Beside
    the object it may be taken for one; then the hand has closed on nothing, or on an edge, and says so."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    pushed = []

    def beside(t):
        if not pushed and t._reach is not None and t.rig.t > t._reach.begin + after:
            pushed.append(t.rig.t)
        if pushed:
            t.rig.cell.set_push([-40.0 if t.rig.t < pushed[0] + 1.0 else 0.0, 0.0, 0.0])

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    documented = {ReasonCode.NONE, ReasonCode.NO_CONTACT, ReasonCode.NOT_RELEASED, ReasonCode.OBJECT_NOT_SEEN}
    assert pushed and result.outcome in outcomes and result.code in documented, trial.ctx.journal.why()
    assert (result.outcome == "succeeded") == (trial.rig.cell.truth()["held_by"] == "robot")
    assert result.outcome == "succeeded" or (result.reason and at_home(trial) and not trial.rig.cell.truth()["dropped"])
    assert trial.last_hub == ("wait_with_object" if result.outcome == "succeeded" else "wait_without_object")
    assert after > 0.5 or "bumped" in result.marks
    assert trial.rig.robot.limit_violations == 0


def test_who_offers_and_withdraws_five_times_is_not_chased():
    """Each ends because the goal went back or left the region, and the sixth offer is taken. The palm goes toward the
    hand with at most 0.25 m/s from 0.2 s after that is 0.10 m back, and not much faster 0.2 s after it has turned."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True, behaviour="withdraws")
    fastest, fastest_after, turned, back = {}, {}, {}, {}

    def beside(t):
        human, chain, report = t.rig.human, t.rig.robot.chain, t.rig.robot.report
        if human.phase != "retreating" or t._reach is None or human.trial > 5:
            return
        position, velocity = (np.asarray(report[name]) for name in ("position", "measured_velocity"))
        hand = np.asarray(t.rig.truth["human_hand"]["position"])
        way = hand - chain.fk(position)[0]
        toward = float(way / np.linalg.norm(way) @ (chain.jacobian(position)[:3] @ velocity))
        k = human.trial
        if float(np.linalg.norm(hand - turned.setdefault(k, hand))) > 0.10:
            back.setdefault(k, t.rig.t)
        if t.rig.t > human._since + 0.2:
            fastest[k] = max(fastest.get(k, 0.0), toward)
        if t.rig.t > back.get(k, np.inf) + 0.2:
            fastest_after[k] = max(fastest_after.get(k, 0.0), toward)

    trial.beside = beside
    results = trial.run(*[RECEIVE] * 6)
    ends = [(r.outcome, r.code) for r in results]
    assert all(end[0] == "failed_empty" for end in ends[:5]) and ends[5][0] == "succeeded", ends
    assert {end[1] for end in ends[:5]} <= {
        ReasonCode.GOAL_WITHDRAWN,
        ReasonCode.GOAL_LEFT_REGION,
        ReasonCode.GOAL_AHEAD_OUTSIDE,
    }, ends
    assert all(r.reason for r in results[:5])
    assert trial.rig.robot.limit_violations == 0
    assert max(fastest_after.values()) <= 0.25
    assert np.median(list(fastest.values())) <= 0.3 and max(fastest.values()) <= 0.6


def test_a_tug_while_the_hand_has_closed():
    """A person who pulls to and fro before letting go: at most 15 N between the two hands."""
    trial = VirtualTrial(seed=31, profile="accustomed", perfect=True, behaviour="tug")
    forces = [0.0]

    def beside(t):
        if t._reach is None and t.begun:
            forces.append(float(np.linalg.norm(t.rig.cell.truth()["human_force"])))

    trial.beside = beside
    results = trial.run(RECEIVE)
    assert results[0].outcome == "succeeded", trial.ctx.journal.why()
    assert 5.0 < max(forces) <= 15.0


def test_a_tug_while_the_fingers_close():
    """14 N for 0.3 s: the palm goes along, and the object is received all the same."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    tug, forces, orders = [], [], HandOrders(trial)

    def beside(t):
        if not tug and t.ctx.journal.marked("closing"):
            tug.append(t.rig.t + 0.1)
        if tug:
            t.rig.cell.set_push([0.0, 14.0 if tug[0] < t.rig.t < tug[0] + 0.3 else 0.0, 0.0])
            forces.append(float(np.linalg.norm(t.rig.cell.truth()["human_force"])))

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    assert result.outcome == "succeeded" and "gave_way" in result.marks, trial.ctx.journal.why()
    # The tug itself is 14 N: what the hand adds to it is no more than the arm's own inertia.
    assert max(forces) <= 15.0 and orders.gentle() and result.code == ReasonCode.NONE
    assert trial.rig.cell.truth()["held_by"] == "robot" and trial.rig.robot.limit_violations == 0


def test_a_hand_that_stays_in_the_gripper():
    """The person holds on until the robot gives up: closed with the lowest force level, pulled at with 15 N at most,
    and given back."""
    trial = VirtualTrial(seed=31, profile="accustomed", perfect=True, behaviour="never_release")
    forces, orders = [], HandOrders(trial)

    def beside(t):
        if t.ctx.journal.marked("closing"):
            forces.append(float(np.linalg.norm(t.rig.cell.truth()["human_force"])))

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    assert result.outcome == "failed_empty" and result.code == ReasonCode.NOT_RELEASED
    assert "the person did not let go of 'mug'" in trial.ctx.journal.why()
    assert orders.gentle() and 1.0 < max(forces) <= 15.0
    assert trial.rig.cell.truth()["held_by"] == "human" and at_home(trial)


def test_an_object_that_leaves_the_persons_hand_on_the_way():
    """It falls while the arm comes: the reach ends at once, with its own reason, and the arm goes home."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    fallen, fastest = [], [0.0]

    def beside(t):
        if not fallen and t._reach is not None and t.rig.t > t._reach.begin + 0.4:
            fallen.append(t.rig.t)
            step = t.rig.human.step
            t.rig.human.step = lambda now, view: replace(step(now, view), grip=0.0, grip_force=0.0)
        if fallen and t.rig.t > fallen[0] + 0.5:
            velocity = np.asarray(t.rig.robot.report["measured_velocity"])
            speed = t.rig.robot.chain.jacobian(np.asarray(t.rig.robot.report["position"]))[:3] @ velocity
            fastest[0] = max(fastest[0], -float(speed[2]))

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    assert fallen and result.outcome == "failed_empty" and result.code == ReasonCode.GOAL_FELL, result
    assert "falls" in trial.ctx.journal.why() and at_home(trial)
    assert fastest[0] < 0.25 and trial.rig.robot.limit_violations == 0
