"""Fingers start to close during the reach if the object is seen between them. A hand that has touched something else
opens before it reaches again."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.machines import recovery
from coglab_smach.ports.pending import Polled, PortError
from coglab_smach.states import reach
from conftest import Trial

RECEIVE = "exchange_human_to_robot"


def at_the_palm(trial):
    """The person's hand is 0.1 m from the robot's."""
    palm, _ = default_arm().fk(np.asarray(trial.cell.arm.position()))
    trial.cell.objects["human_hand"] = Pose(palm + [0.1, 0.0, 0.0])


def receive(monkeypatch, away, touch_after=1.5, **settings):
    """Receive with the object seen ``away(looks)`` m off its grasp and a touch after ``touch_after`` s. Returns the
    trial and the calls with their times."""
    trial, looks = Trial(**settings), []

    def off_grasp(state, goal):
        looks.append(trial.clock.now())
        return away(len(looks))

    monkeypatch.setattr(reach, "off_grasp", off_grasp)
    trial.cell.partner.touch_after = touch_after

    trial.run(Trial.receive)
    assert trial.result().outcome == "succeeded"
    return trial, [name for _, name in trial.cell.calls]


def test_fingers_start_to_close_before_contact(monkeypatch):
    trial, calls = receive(monkeypatch, lambda looks: 0.02)
    marks = trial.result().marks
    assert marks["closing_on_the_way"] < marks["contact"] <= marks["closing"]
    assert calls[: calls.index("arm lift")].count("close") == 1, (
        "a second order would open the hand to its preshape first"
    )


@pytest.mark.parametrize("case", ["switched off", "elsewhere", "not seen"])
def test_fingers_wait_for_contact_if_they_might_close_on_nothing(monkeypatch, case):
    away = {"switched off": lambda n: 0.02, "elsewhere": lambda n: 0.06, "not seen": lambda n: None}[case]
    settings = {"handover.close_within": 0.0} if case == "switched off" else {}
    trial, calls = receive(monkeypatch, away, **settings)
    assert "closing_on_the_way" not in trial.result().marks
    assert calls[: calls.index("arm lift")].count("close") == 1


def test_a_hand_that_touched_something_else_opens_before_it_reaches_again(monkeypatch):
    """At the first look the object is between the fingers, at the touch it is elsewhere."""
    trial, calls = receive(monkeypatch, lambda looks: 0.2 if looks == 2 else 0.02, touch_after=0.3)
    assert "bumped" in trial.result().marks
    first, again = calls.index("close"), [i for i, name in enumerate(calls) if name == "execute_dmp"][1]
    assert any(name.startswith("preshape") for name in calls[first:again]), calls
    # The arm stands before it retreats: a motion that starts while it moves brakes later.
    assert calls.index("cancel") < calls.index("move_ptp", first), calls


def test_the_arm_waits_for_a_goal_that_is_hidden_for_a_moment(monkeypatch):
    """After a touch of something else, the tracker loses the object for 0.5 s."""
    # In this cell the object follows the palm from the touch on.
    trial = Trial(**{"handover.retreat": 2.0, "handover.drop": 0.0})
    trial.cell.partner.touch_after = 0.3
    looks, refused, execute = [], [], trial.ctx.arm.execute_dmp

    def off_grasp(state, goal):
        looks.append(1)
        return 0.02 if refused else 0.2

    def hidden(request):
        if looks and (not refused or trial.clock.now() < refused[0] + 0.5):
            refused.append(trial.clock.now())
            trial.cell.faults.refuse["execute_dmp"] = PortError("the goal is 0.3 s old", code=ReasonCode.GOAL_STALE)
        else:
            trial.cell.faults.refuse.pop("execute_dmp", None)
        return execute(request)

    monkeypatch.setattr(reach, "off_grasp", off_grasp)
    trial.ctx.arm.execute_dmp = hidden

    trial.run(Trial.receive)
    assert trial.result().outcome == "succeeded" and len(refused) > 5, trial.ctx.journal.why()


def test_a_running_preshape_is_not_interrupted(monkeypatch):
    """A closing order would end the preshape, and with it the reach."""
    trial, calls = receive(monkeypatch, lambda looks: 0.02, touch_after=2.0)
    began = [stamp for stamp, name in trial.cell.calls if name.startswith("preshape")][0]
    closed = [stamp for stamp, name in trial.cell.calls if name == "close"][0]
    assert closed >= began + 0.8, calls


@pytest.mark.parametrize("why", ["contact", "goal lost"])
def test_the_arm_stays_if_closed_fingers_do_not_open_again(monkeypatch, why):
    """The fingers have started to close, the reach fails, and the hand is stuck: the person may hold the object."""
    trial = Trial()
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)
    monkeypatch.setattr(recovery, "person_has_it", lambda *_: True)
    trial.cell.partner.touch_after = None

    def script(t):
        t.begin()
        t.until(lambda: t.ctx.journal.marked("closing_on_the_way"))
        moved = t.cell.called("move_ptp")
        t.cell.faults.refuse["open"] = PortError("motors 2, 3 are stuck", code=ReasonCode.HAND_STALLED)
        if why == "goal lost":
            t.cell.arm.end("goal lost", ReasonCode.GOAL_LOST)
        t.wait_hub("stopped")
        t.clock.sleep(5.0)
        assert t.cell.called("move_ptp") == moved, "the arm moved away with it"
        assert t.ctx.journal.newest_failure().code == ReasonCode.NOT_RELEASED
        t.cell.faults.refuse.clear()
        t.start("reset", "")
        t.wait_hub("wait_without_object")

    trial.run(script)
    result = trial.result()
    assert result.code == ReasonCode.NOT_RELEASED and any(why in cause for cause in result.causes), result


@pytest.mark.parametrize("person", ["away", "not seen", "at it"])
def test_object_caught_during_the_reach_is_not_dropped(monkeypatch, person):
    """The person lets go at the first touch, then the goal is lost. Only a person at the object gets it back."""
    trial = Trial()
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)
    trial.cell.partner.touch_after = None
    trial.cell.partner.take_after = 1.0 if person == "at it" else None

    def script(t):
        t.begin()
        t.until(lambda: t.ctx.journal.marked("closing_on_the_way"))
        t.cell.at_palm = ("mug", Pose([-0.05, 0.0, 0.0]))
        if person == "at it":
            at_the_palm(t)
        if person == "away":
            t.cell.goes = t.clock.now(), np.array([2.0, 0.0, 0.4])
        if person == "not seen":
            t.cell.faults.not_seen.add("human_hand")
        t.cell.arm.end("goal lost", ReasonCode.GOAL_LOST)
        t.wait_hub({"away": "wait_with_object", "not seen": "stopped", "at it": "wait_without_object"}[person])
        assert (t.cell.called("open") != []) == (person == "at it")
        assert person == "at it" or t.ctx.holding == "mug"

    trial.run(script)
    result = trial.result()
    assert result.outcome == {"away": "failed_holding", "not seen": "stopped", "at it": "failed_empty"}[person]
    assert result.code == (ReasonCode.NOT_RELEASED if person == "not seen" else ReasonCode.GOAL_LOST)


def test_reopened_fingers_hold_no_object_of_the_person(monkeypatch):
    """After a touch of something else the goal is lost, then the open hand is stuck: the arm goes home."""
    trial, looks = Trial(), []

    def off_grasp(state, goal):
        looks.append(trial.clock.now())
        return 0.02 if len(looks) == 1 else 0.2

    monkeypatch.setattr(reach, "off_grasp", off_grasp)
    trial.cell.partner.touch_after = 0.3

    def script(t):
        t.begin()
        while t.cell.called().count("execute_dmp") < 2:
            t.clock.sleep(0.01)
        t.cell.faults.refuse["open"] = PortError("motors 2, 3 are stuck", code=ReasonCode.HAND_STALLED)
        t.clock.sleep(0.1)
        t.cell.arm.end("goal lost", ReasonCode.GOAL_LOST)
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert "bumped" in trial.result().marks and trial.result().code == ReasonCode.GOAL_LOST


def test_closing_fingers_open_before_a_paused_reach_continues(monkeypatch):
    """A fist would push the offered object away."""
    trial, waits = Trial(), []
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)
    trial.cell.partner.touch_after, trial.cell.faults.empty_grasp = 3.0, True
    doubted = reach.ReachWatch.doubted
    monkeypatch.setattr(
        reach.ReachWatch,
        "doubted",
        lambda watch: not waits and trial.grip.closing is not None and not waits.append(1) or doubted(watch),
    )

    def script(t):
        t.begin()
        t.until(t.ctx.requests.hub)

    trial.run(script)
    calls = trial.cell.called()
    again = [i for i, name in enumerate(calls) if name == "execute_dmp"][1]
    between = calls[calls.index("close") : again]
    assert "paused" in trial.result().marks and any(name.startswith("preshape") for name in between), calls


def test_stop_halts_closing_fingers_at_once(monkeypatch):
    trial, cancelled = Trial(), []
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)
    trial.cell.partner.touch_after = None
    trial.ctx.hand.close_on_object = lambda: Polled(
        lambda: False, lambda: None, lambda: cancelled.append(trial.clock.now())
    )

    def script(t):
        t.begin()
        t.until(lambda: t.ctx.journal.marked("closing_on_the_way"))
        pressed.append(t.clock.now())
        t.ctx.stop.press("a finger is in it")
        t.wait_hub("stopped")

    pressed: list[float] = []
    trial.run(script)
    assert cancelled and cancelled[0] - pressed[0] < 0.05
