"""Whole trials with faults or a difficult person. Each ends in a hub with its reason and exceeds no limit. The arm does
not follow a withdrawn object; near a hand, the fingers neither close firmly nor drop the object."""

import threading
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import smach
from coglab_msgs.msg import ReasonCode, Say
from coglab_smach.ports.pending import Polled
from coglab_trials import GIVE, RECEIVE, VirtualTrial
from coglab_trials.conditions import CONSIDERATE
from coglab_trials.virtual_clock import ClockStalled, VirtualClock
from hand_orders import HandOrders

WITHDRAWN = {ReasonCode.GOAL_WITHDRAWN, ReasonCode.GOAL_LEFT_REGION, ReasonCode.GOAL_AHEAD_OUTSIDE}


def trial_of(behaviour="normal", seed=4, **settings):
    return VirtualTrial(seed, replace(CONSIDERATE, behaviour=behaviour), settings=settings)


def once(trial, condition, act):
    """Call act(trial) when ``condition`` is first true. Returns a list that then contains the time."""
    happened, before = [], trial.beside

    def look(t):
        before(t)
        if not happened and condition(t):
            happened.append(t.world.t)
            act(t)

    trial.beside = look
    return happened


def into_reach(seconds, action=""):
    """Condition: ``seconds`` after the start of a reach, in ``action`` if given."""

    def condition(t):
        begun = t.reach is not None and t.world.t > t.reach.begin + seconds
        return begun and (not action or t.begun[-1:] == [action])

    return condition


def pushed(trial, condition, force, seconds):
    """From ``condition`` on, push the arm with ``force`` (N) for ``seconds``."""

    def look(t):
        if begun:
            t.world.cell.set_push(force if t.world.t < begun[0] + seconds else [0.0, 0.0, 0.0])

    begun = once(trial, condition, lambda t: None)
    before = trial.beside
    trial.beside = lambda t: (before(t), look(t))
    return begun


def at_home(trial):
    home = np.array(trial.ctx.config.get("postures.home"))
    return np.max(np.abs(np.asarray(trial.world.robot.report["position"]) - home)) < 0.03


def ended(trial, outcome, codes, held_by="", dropped=False):
    """Returns the last result after checks of its outcome and code, the hub, and the arm at home."""
    result, truth = trial.results[-1], trial.world.cell.truth()
    assert result.outcome == outcome and result.code in codes, result
    holding = (result.action == RECEIVE) == (outcome == "succeeded") if outcome != "failed_empty" else False
    holding = holding or outcome == "failed_holding"
    assert trial.last_hub == ("wait_with_object" if holding else "wait_without_object")
    assert bool(trial.ctx.holding) == holding and at_home(trial) and truth["dropped"] == dropped
    assert not held_by or truth["held_by"] == held_by
    assert (outcome == "succeeded") != bool(result.reason) and trial.world.robot.limit_violations == 0
    return result


# --- faults -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after, slow, outcome", [(0.3, 4.0, "failed_empty"), (0.5, 1.0, "succeeded")])
def test_a_lost_goal_ends_a_slow_reach_but_not_the_end_of_a_fast_one(after, slow, outcome):
    trial = trial_of(**{"handover.reach_ratio": slow} if slow != 1.0 else {})
    once(trial, into_reach(after), lambda t: t.world.blind.add("object_mug"))
    trial.run(RECEIVE)
    ended(trial, outcome, {ReasonCode.NONE if outcome == "succeeded" else ReasonCode.GOAL_LOST})


def test_reset_after_command_mode_was_lost_during_a_reach():
    trial = trial_of()
    cut = once(trial, into_reach(0.4), lambda t: t.world.cell.leave_command_mode("cut by the test"))

    def script(t):
        t.wait_hub("wait_without_object")
        t.submit(RECEIVE)
        t.wait_hub("stopped")
        assert "monitor mode" in t.why()
        assert t.submit("reset", "")
        t.wait_hub("wait_without_object")

    (result,) = trial.run(script=script)
    assert cut and result.outcome == "stopped" and at_home(trial) and trial.world.robot.limit_violations == 0


def test_stop_while_the_hand_opens_and_the_person_takes_the_object():
    """STOP halts the fingers, and the hand reports a grip. The object is seen with the person, so the hand counts as
    empty, and the next hub is the one without an object."""
    trial = trial_of()
    trial.submitted = False
    opens = lambda t: [r.to_state for r in t.ctx.journal.transitions[-1:]] == ["hand_open"]  # noqa: E731
    pressed = once(trial, lambda t: t.submitted and opens(t), lambda t: t.ctx.stop.press("the test"))

    def script(t):
        t.ask_for(RECEIVE)
        t.submitted = t.submit(GIVE)
        t.wait_hub("stopped")
        while t.world.cell.truth()["held_by"] != "human" or t.world.human.phase != "idle":
            t.clock.sleep(0.05)
        assert t.ctx.hand.state().holding, "condition of this test"
        assert t.submit("reset", "")
        t.wait_hub("wait_without_object")
        assert not t.ctx.hand.state().holding and t.ctx.holding == ""

    trial.run(script=script)
    assert pressed and at_home(trial) and not trial.world.cell.truth()["dropped"]


@pytest.mark.parametrize("when", ["home", "to the person"])
def test_an_object_that_leaves_the_robots_hand_during_a_motion(when):
    """The fingers open by themselves. The arm does not continue to the person, and no message is sent."""
    trial = trial_of()
    weighed = lambda t: any(move.from_state == "take_weight" for move in t.ctx.journal.transitions)  # noqa: E731

    def let_go(t):
        for motor in range(1, 5):
            t.world.hand.driver.move_motor(motor, 511, False)

    once(trial, weighed if when == "home" else into_reach(0.3, GIVE), let_go)
    trial.run(RECEIVE, GIVE)
    assert ended(trial, "failed_empty", {ReasonCode.OBJECT_NOT_SEEN}, dropped=True).action == (
        RECEIVE if when == "home" else GIVE
    )
    assert Say.YOU_HAVE_IT not in [code for _, code in trial.said]


def test_an_object_that_falls_during_the_reach():
    """It falls from the person's hand: the reach ends at once with its reason, and the arm does not follow."""
    trial, fastest = trial_of(), [0.0]

    def drop(t):
        step = t.world.human.step
        t.world.human.step = lambda now, view: replace(step(now, view), grip=0.0, grip_force=0.0)

    fallen = once(trial, into_reach(0.4), drop)
    before = trial.beside

    def look(t):
        before(t)
        if fallen and t.world.t > fallen[0] + 0.5:
            report = t.world.robot.report
            jacobian = t.world.robot.chain.jacobian(np.asarray(report["position"]))
            fastest[0] = max(fastest[0], -float(jacobian[2] @ np.asarray(report["measured_velocity"])))

    trial.beside = look
    trial.run(RECEIVE)
    ended(trial, "failed_empty", {ReasonCode.GOAL_FELL}, dropped=True)
    assert fastest[0] < 0.25


# --- pushes and pulls -------------------------------------------------------------------------------------------------


def test_a_push_while_the_robot_gives():
    """60 N for 1 s: the hand keeps the object, then gives it to the waiting person."""
    trial = trial_of()
    begun = pushed(trial, into_reach(0.8, GIVE), [-60.0, 0.0, 0.0], 1.0)
    trial.run(RECEIVE, GIVE)
    assert begun and ended(trial, "succeeded", {ReasonCode.NONE}, "human")


@pytest.mark.parametrize("after, outcomes", [(0.3, ["succeeded"]), (0.8, ["succeeded", "failed_empty"])])
def test_a_push_while_the_robot_receives(after, outcomes):
    """40 N for 1 s. Early in the reach it is no contact: the arm retreats, reaches again and takes the object. Near the
    object it may count as contact; then the hand has closed on nothing or on an edge, and the action fails."""
    trial = trial_of()
    begun = pushed(trial, into_reach(after), [-40.0, 0.0, 0.0], 1.0)
    (result,) = trial.run(RECEIVE)
    documented = {ReasonCode.NONE, ReasonCode.NO_CONTACT, ReasonCode.NOT_RELEASED, ReasonCode.OBJECT_NOT_SEEN}
    assert begun and result.outcome in outcomes
    ended(trial, result.outcome, documented, "robot" if result.outcome == "succeeded" else "")
    assert after > 0.5 or "bumped" in result.marks


def pull(trial, condition):
    """Returns a list; after the trial it has the largest force (N) between the two hands from ``condition`` on."""
    largest, before = [0.0], trial.beside

    def look(t):
        before(t)
        if condition(t):
            largest[0] = max(largest[0], float(np.linalg.norm(t.world.cell.truth()["human_force"])))

    trial.beside = look
    return largest


def test_a_tug_while_the_hand_has_closed():
    """The person pulls in both directions before letting go: at most 15 N between the two hands."""
    trial = trial_of("tug", 31)
    largest = pull(trial, lambda t: t.begun and t.reach is None)
    trial.run(RECEIVE)
    ended(trial, "succeeded", {ReasonCode.NONE})
    assert 5.0 < largest[0] <= 15.0


def test_a_tug_while_the_fingers_close():
    """14 N for 0.3 s: the palm yields, and the object is received."""
    trial = trial_of()
    orders, closing = HandOrders(trial), once(trial, lambda t: t.ctx.journal.marked("closing"), lambda t: None)
    pushed(trial, lambda t: closing and t.world.t > closing[0] + 0.1, [0.0, 14.0, 0.0], 0.3)
    largest = pull(trial, lambda t: closing)
    trial.run(RECEIVE)
    assert "gave_way" in ended(trial, "succeeded", {ReasonCode.NONE}, "robot").marks
    # The tug itself is 14 N; the hand adds at most the arm's inertia.
    assert largest[0] <= 15.0 and orders.gentle()


def test_a_person_who_never_lets_go():
    """The person holds on until the robot gives up. The robot uses the lowest force level, pulls with at most 15 N, and
    gives the object back."""
    trial = trial_of("never_release", 31)
    orders, largest = HandOrders(trial), pull(trial, lambda t: t.ctx.journal.marked("closing"))
    trial.run(RECEIVE)
    ended(trial, "failed_empty", {ReasonCode.NOT_RELEASED}, "human")
    assert orders.gentle() and 1.0 < largest[0] <= 15.0


# --- withdrawals ------------------------------------------------------------------------------------------------------


def test_the_arm_does_not_follow_five_withdrawn_offers():
    """Each reach ends because the goal went back or left the region; the sixth offer is taken. From 0.2 s after the
    hand is 0.10 m back, the palm moves toward it with at most 0.25 m/s."""
    trial, fastest, turned, back = trial_of("withdraws"), [0.0], {}, {}

    def look(t):
        human, robot = t.world.human, t.world.robot
        if human.phase != "retreating" or t.reach is None or human.trial > 5:
            return
        position, velocity = (np.asarray(robot.report[name]) for name in ("position", "measured_velocity"))
        hand = np.asarray(t.world.truth["human_hand"]["position"])
        way = hand - robot.palm().position
        if float(np.linalg.norm(hand - turned.setdefault(human.trial, hand))) > 0.10:
            back.setdefault(human.trial, t.world.t)
        if t.world.t > back.get(human.trial, np.inf) + 0.2:
            toward = way / np.linalg.norm(way) @ (robot.chain.jacobian(position)[:3] @ velocity)
            fastest[0] = max(fastest[0], float(toward))

    trial.beside = look
    results = trial.run(*[RECEIVE] * 6)
    assert [r.outcome for r in results] == ["failed_empty"] * 5 + ["succeeded"]
    assert {r.code for r in results[:5]} <= WITHDRAWN and 0.0 < fastest[0] <= 0.25
    assert trial.world.robot.limit_violations == 0


def receiving(there_before):
    """Returns a script: one exchange. The object is offered from then on, or was ``there_before``."""

    def script(t):
        t.wait_hub("wait_without_object")
        if there_before:
            t.world.human.command("give mug")
            while t.world.human.phase != "waiting":
                t.clock.sleep(0.05)
        t.submit(RECEIVE)
        t.begun.append(RECEIVE)
        end = t.clock.now() + 60.0
        while not t.results and t.clock.now() < end:
            t.clock.sleep(0.05)

    return script


@pytest.mark.parametrize("timing, there_before", [("calm", False), ("natural", False), ("natural", True)])
def test_the_arm_does_not_follow_a_person_who_pushes_it_and_leaves(timing, there_before):
    """40 N for 1 s; while the arm retreats, the person takes the object away. The arm does not follow, whether the
    reach began on a belief or on a sight."""
    trial, toward = trial_of(timing=timing), []
    pushed(trial, into_reach(0.3), [-40.0, 0.0, 0.0], 1.0)
    gone = once(trial, lambda t: t.ctx.journal.marked("bumped"), lambda t: t.world.human.command("rest"))
    before = trial.beside

    def look(t):
        before(t)
        if gone and t.world.t > gone[0] + 0.7:
            truth, chain = t.world.cell.truth(), t.world.robot.chain
            way = np.asarray(truth["human_hand"]["position"]) - np.asarray(truth["robot_hand"]["position"])
            velocity = chain.jacobian(truth["position"])[:3] @ truth["velocity"]
            toward.append(float(velocity @ way / np.linalg.norm(way)))

    trial.beside = look
    (result,) = trial.run(script=receiving(there_before))
    assert gone and result.outcome == "failed_empty" and result.code in WITHDRAWN, result
    assert max(toward) < 0.05


def test_a_hidden_object_that_is_taken_back_ends_the_reach():
    trial = trial_of()

    def take_back(t):
        t.world.blind.add("object_mug")
        t.world.human.command("rest")

    gone = once(trial, into_reach(0.15), take_back)
    (result,) = trial.run(script=receiving(True))
    assert gone and result.outcome == "failed_empty" and result.reason
    assert result.code in {ReasonCode.GOAL_WITHDRAWN, ReasonCode.GOAL_LOST}, result


# --- holders ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("when", ["closed", "loaded"])
def test_the_robot_keeps_the_object_beside_a_hand_that_does_not_hold(when):
    """The person lets go, but the hand stays at the object, which would fall if the robot opened."""
    trial = trial_of("never_release")

    def lets_go(t):
        step = t.world.human.step
        t.world.human.step = lambda now, view: replace(step(now, view), grip=0.0, grip_force=0.0)

    done = once(trial, lambda t: t.begun and t.ctx.journal.marked(when), lets_go)
    (result,) = trial.run(RECEIVE)
    truth = trial.world.cell.truth()
    assert done and not truth["dropped"] and truth["held_by"] in ("robot", "both"), trial.why()
    assert result.outcome == "failed_holding" and result.code == ReasonCode.NOT_RELEASED


@pytest.mark.parametrize("aside, mark, later", [(0.25, "closed", 0.0), (0.6, "closing", 0.3)])
def test_a_confused_tracker_does_not_release_the_object(aside, mark, later):
    """The person never lets go. The tracker shows their hand elsewhere from ``mark`` on."""
    trial = trial_of("never_release")
    locate = trial.ctx.perception.locate_object
    since = once(trial, lambda t: t.begun and t.ctx.journal.marked(mark), lambda t: None)

    def located(name, limit):
        pending = locate(name, limit)
        if name != "human_hand" or not since or trial.world.t < since[0] + later:
            return pending
        beside = lambda seen: replace(seen, xyz=tuple(np.array(seen.xyz) + [0.0, aside, 0.0]))  # noqa: E731
        return Polled(pending.done, lambda: beside(pending.result()))

    trial.ctx.perception.locate_object = located
    (result,) = trial.run(RECEIVE)
    assert since and result.code == ReasonCode.NOT_RELEASED and "tightened" not in result.marks, result
    assert result.outcome in ("stopped", "failed_empty") and not trial.world.cell.truth()["dropped"]


@pytest.mark.parametrize("after", [0.5, 0.8])
def test_an_object_in_closed_fingers_is_not_dropped_after_the_person_let_go(after):
    """The reach ends while the fingers close. The person lets go, and the hand stays there."""
    trial, held = trial_of(), []
    step = trial.world.human.step
    began = once(trial, lambda t: t.begun and t.ctx.journal.marked("closing_on_the_way"), lambda t: None)
    once(trial, lambda t: began and t.world.t > began[0] + 0.06, lambda t: t.ctx.arm.cancel_motion("the goal is lost"))

    def let_go(now, view):
        action = step(now, view)
        if not began or now < began[0] + after:
            return action
        held.append(action.frame)
        return replace(action, frame=held[0], velocity=np.zeros(3), grip=0.0, grip_force=0.0)

    trial.world.human.step = let_go
    (result,) = trial.run(RECEIVE)
    truth = trial.world.cell.truth()
    assert held and not truth["dropped"] and truth["held_by"] == "robot", (result, truth["held_by"])


class Rests(smach.State):
    """Waits for 100 s and ignores preemption."""

    def __init__(self, clock):
        smach.State.__init__(self, ["done"])
        self.clock = clock

    def execute(self, ud=None):
        self.clock.sleep(100.0)
        return "done"


def test_a_stalled_trial_leaves_no_thread_behind(monkeypatch):
    """A world that runs on would keep its process alive."""
    monkeypatch.setattr("coglab_trials.trial.VirtualClock", partial(VirtualClock, stall_limit=0.4))
    before, trial = set(threading.enumerate()), VirtualTrial(4, machine=lambda ctx: Rests(ctx.clock))
    once(trial, lambda t: t.clock.now() > 0.1, lambda t: [time.sleep(0.1) for _ in range(50)])  # a stop is no stall
    with pytest.raises(ClockStalled, match="world"):
        trial.run(script=lambda t: None)
    for thread in set(threading.enumerate()) - before:
        thread.join(120.0)
        assert not thread.is_alive(), thread
