"""A reach at the edges of its figures: when fingers close on the way, when the hand slides in, goes on, comes again or
gives up."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import ContactEvent, DmpProgress, Verdict
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states import reach
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.monitor import MonitorDmp
from coglab_smach.states.reach import ExecuteDmp, WaitStop, dmp_request, start
from coglab_trials.virtual_clock import using
from conftest import Trial
from early_goal import GOAL, HIGH


def test_a_request_has_what_its_goal_says_and_nothing_else():
    plain = dmp_request({"primitive": "p", "frame": "f", "offset": (1, 2, 3)})
    assert (plain.dmp_ratio, plain.orientation_control, plain.arrival_speed) == (1.0, False, 0.0)
    assert plain.target_orientation == [0.0] * 4 and plain.goal_approach == (0.0, 0.0, 0.0)
    whole = dmp_request({**GOAL, "approach": [0.0, 0.05, 0.0], "arrival_speed": 0.05}, "q")
    assert (whole.primitive_id, whole.dmp_ratio, whole.orientation_control) == ("q", 1.5, True)
    assert (whole.goal_approach, whole.arrival_speed, whole.goal_region_high) == ([0.0, 0.05, 0.0], 0.05, HIGH)
    assert dmp_request(GOAL, ratio=0.0).dmp_ratio == 0.0


class Waiting:
    """A WaitStop for contact, on an arm whose progress the test says."""

    def __init__(self, progress=None, **settings):
        self.trial = Trial(**settings)
        ctx = self.ctx = self.trial.ctx
        self.progress = progress or DmpProgress("running", "", "reach_human", 0.5, 0.05)
        self.event, self.calls = None, []
        ctx.arm.dmp_progress = lambda: self.progress
        ctx.arm.motion_allowed = lambda: Verdict(True)
        ctx.arm.execute_dmp = lambda request: self.calls.append(request) or Ready()
        ctx.contact.event = lambda: self.event
        ctx.hand.close_on_object = lambda: self.calls.append("close") or Ready()
        self.state = WaitStop(ctx, "contact")
        self.state._deadline = 1e9

    def run(self, work, seconds=None):
        with using(self.trial.clock) as clock:
            begin = clock.now()
            result = work()
            assert seconds is None or clock.now() - begin == pytest.approx(seconds, abs=0.03)
            return result


@pytest.mark.parametrize(
    ("to_go", "off", "preshaped", "closes"),
    [
        (0.029, 0.039, True, True),
        (0.031, 0.0, True, False),
        (0.0, 0.0, True, False),
        (0.02, 0.041, True, False),
        (0.02, None, True, False),
        (0.02, 0.0, False, False),
    ],
)
def test_fingers_close_on_the_last_3_cm_on_what_is_seen_a_centimetre_beyond(monkeypatch, to_go, off, preshaped, closes):
    waiting = Waiting(DmpProgress("running", "", "reach_human", 0.1, to_go))
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: off)
    waiting.ctx.preshaped = preshaped
    waiting.run(lambda: waiting.state._close_on_the_way(GOAL))
    assert waiting.calls == (["close"] if closes else []) and waiting.ctx.shared == closes
    assert waiting.ctx.closing_on == ("mug" if closes else "")


@pytest.mark.parametrize(
    ("off", "margin", "seconds"),
    [(lambda t: 0.031, 1.0, 0.6), (lambda t: 0.03, 1.0, 0.0), (lambda t: 0.05, 2.5, 0.0), (lambda t: 0.05, 2.4, 0.6)],
)
def test_the_hand_slides_in_for_six_tenths_of_a_second_at_most(monkeypatch, off, margin, seconds):
    waiting, armed = Waiting(), []
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: off(0.0))
    waiting.ctx.contact.arm = lambda mode, limit, settings: armed.append((mode, limit)) or Ready()
    waiting.event = ContactEvent(True, "x", margin)
    ud = SimpleNamespace(object_entry={"mass": 0.3}, goal=GOAL)
    waiting.run(lambda: waiting.state._slide_in(ud), seconds)
    assert set(armed) == ({("contact_in_motion", 1.0)} if seconds else set())
    waiting.ctx.arm.speed_scale = lambda: 0.5
    waiting.run(lambda: waiting.state._slide_in(ud), 2.0 * seconds)
    waiting.ctx.arm.speed_scale = lambda: 0.01
    waiting.run(lambda: waiting.state._slide_in(ud), 10.0 * seconds)


def received(monkeypatch, off):
    """A reach of the whole machine with the object seen ``off(touches)`` m off its grasp."""
    # In this cell the object is at the palm from the touch on, wherever the palm is, and goes with it.
    anywhere = {
        "handover.region_low": [-2.0] * 3,
        "handover.region_high": [2.0] * 3,
        "handover.retreat": 2.0,
        "handover.drop": 0.0,
    }
    trial, looks = Trial(**{"handover.close_within": 0.0}, **anywhere), []
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: off(looks.append(1) or len(looks)))
    trial.cell.partner.touch_after = 0.3

    def script(t):
        t.wait_hub("wait_without_object")
        t.start("exchange_human_to_robot")
        t.clock.sleep(1.0)
        t.until(t.ctx.requests.hub)

    trial.run(script)
    return trial


@pytest.mark.parametrize(("off", "again"), [(0.089, False), (0.091, True)])
def test_what_is_9_cm_from_its_grasp_is_not_what_touches_the_hand(monkeypatch, off, again):
    trial = received(monkeypatch, lambda looks: off if looks == 1 else 0.02)
    assert ("bumped" in trial.result().marks) == again and trial.result().outcome == "succeeded"


def test_after_two_touches_of_something_else_it_comes_again_and_after_three_it_gives_up(monkeypatch):
    trial = received(monkeypatch, lambda looks: 0.2 if looks <= 2 else 0.02)
    assert trial.result().outcome == "succeeded" and trial.cell.called().count("execute_dmp") == 3
    trial = received(monkeypatch, lambda looks: 0.2)
    assert (trial.result().outcome, trial.result().code) == ("failed_empty", ReasonCode.NO_CONTACT)
    assert trial.cell.called().count("arm contact_in_motion") == 3
    assert trial.cell.called().count("execute_dmp") == 3, "it does not come again only to give up"
    assert "the object is 0.20 m from where it would be held" in trial.result().reason


def test_the_palm_draws_back_by_6_cm_against_its_outward_axis(monkeypatch):
    ways, out, shift, axis = [], [], reach.shift, reach.palm_axis
    monkeypatch.setattr(reach, "shift", lambda ctx, way, speed: ways.append((way, speed)) or shift(ctx, way, speed))
    monkeypatch.setattr(reach, "palm_axis", lambda ctx: out.append(axis(ctx)) or out[-1])
    received(monkeypatch, lambda looks: 0.2 if looks == 1 else 0.02)
    ((way, speed),) = ways
    assert way == pytest.approx(-0.06 * out[0]) and speed == 0.1


@pytest.mark.parametrize(("lost", "good"), [(0.9, True), (1.2, False)])
def test_a_goal_that_is_lost_at_the_start_is_waited_for_one_second(lost, good):
    waiting = Waiting()
    clock, asked = waiting.trial.clock, []
    stale = PortError("old", code=ReasonCode.GOAL_STALE)
    waiting.ctx.arm.execute_dmp = lambda r: (
        asked.append(clock.now()) or Ready(error=stale if clock.now() < lost else None)
    )
    if good:
        waiting.run(lambda: start(waiting.state, dmp_request(GOAL)), 0.9)
    else:
        with pytest.raises(PortError, match="old"):
            waiting.run(lambda: start(waiting.state, dmp_request(GOAL)))
        assert clock.now() == pytest.approx(1.0, abs=0.06)
    assert np.diff(asked) == pytest.approx([0.05] * (len(asked) - 1))
    waiting.ctx.arm.execute_dmp = lambda r: Ready(error=PortError("no", code=ReasonCode.HELD))
    with pytest.raises(PortError, match="no"):
        waiting.run(lambda: start(waiting.state, dmp_request(GOAL)), 0.0)


def test_a_reach_that_is_given_up_has_paused_for_three_seconds():
    waiting = Waiting()
    waiting.ctx.arm.cancel_motion = lambda reason: Ready()
    early = SimpleNamespace(hopeful=lambda: False)
    with pytest.raises(TimeLimit) as error:
        waiting.run(lambda: waiting.state._pause(early, ReasonCode.GOAL_WITHDRAWN, "nobody"))
    assert waiting.trial.clock.now() == pytest.approx(3.0, abs=0.03)
    assert (error.value.sentence, error.value.causes) == ("the reach was given up", ("nobody",))
    assert error.value.code == ReasonCode.GOAL_WITHDRAWN
    clock, forgiven = waiting.trial.clock, []
    back = clock.now() + 2.9
    early.hopeful, early.forgive, early.goal_now = lambda: clock.now() >= back, lambda: forgiven.append(1), lambda: GOAL
    waiting.run(lambda: waiting.state._pause(early, 0, ""), 2.9)
    assert forgiven == [1] and waiting.calls[0].goal_frame == "object_mug_ahead"


@pytest.mark.parametrize(("feel", "goes_on"), [(0.29, False), (0.31, True)])
def test_a_hand_that_feels_nothing_for_three_tenths_of_a_second_goes_on_by_2_cm(monkeypatch, feel, goes_on):
    waiting = Waiting(DmpProgress("reached", "", "reach_human"))
    goal = {**GOAL, "approach": [0.0, 0.0, -0.05]}
    waiting.run(lambda: waiting.state._happened(goal))
    waiting.run(lambda: waiting.trial.clock.sleep(feel))
    assert waiting.run(lambda: waiting.state._happened(goal)) is False
    assert [r.goal_offset for r in waiting.calls] == ([pytest.approx([0.0, 0.0, 0.08])] if goes_on else [])
    waiting.event = ContactEvent(True, "x", 1.5)
    assert waiting.run(lambda: waiting.state._happened(goal)) is True
    assert waiting.state._found(waiting.event) == "succeeded" and waiting.state.reason == "contact by x, margin 1.5"


@pytest.mark.parametrize(("enabled", "switched"), [(True, True), (False, False)])
def test_a_monitor_that_is_switched_off_waits_for_the_end_of_the_motion(enabled, switched):
    trial = Trial(
        **{"monitor.enabled": enabled, "monitor.primitives": {"high": "reach_human_high", "mid": "reach_human"}}
    )
    state, told = MonitorDmp(trial.ctx), []
    trial.cell.partner.pattern, trial.cell.arm.motion_started = "high", 0.0
    trial.ctx.arm.dmp_progress = lambda: DmpProgress("running")
    trial.ctx.arm.switch_dmp = lambda request: told.append(request) or Ready()
    with using(trial.clock) as clock:
        clock.start_thread(lambda: (clock.sleep(2.0), state.request_preempt()), "end")
        state._deadline = 1e9
        if enabled:
            assert state.run(SimpleNamespace(goal=GOAL)) == "preempted" and state.reason == "motion over, 1 switches"
        else:
            with pytest.raises(Exception, match="preempted"):
                state.run(SimpleNamespace(goal=GOAL))
    assert [request.primitive_id for request in told] == (["reach_human_high"] if switched else [])


@pytest.mark.parametrize(
    ("state", "confidence", "decided", "other"),
    [
        ("running", 0.9, True, True),
        ("holding", 0.95, True, True),
        ("reached", 0.95, True, False),
        ("running", 0.89, True, False),
        ("running", 0.95, False, False),
    ],
)
def test_a_pattern_counts_from_nine_tenths_while_the_motion_goes(state, confidence, decided, other):
    trial = Trial()
    monitor = MonitorDmp(trial.ctx)
    trial.ctx.arm.dmp_progress = lambda: DmpProgress(state)
    seen = SimpleNamespace(pattern="high", confidence=confidence, decided=decided)
    trial.ctx.perception.recognition = lambda: seen
    family = {"high": "reach_human_high", "mid": "reach_human"}
    assert bool(monitor._other_pattern(family, "reach_human")) == other
    assert not monitor._other_pattern(family, "reach_human_high") and not monitor._other_pattern({}, "reach_human")


def test_a_reach_without_a_profile_asks_for_none():
    waiting = Waiting()
    state, profiles = ExecuteDmp(waiting.ctx), []
    state._deadline = 1e9
    waiting.ctx.arm.apply_profile = lambda name: profiles.append(name) or Polled(lambda: True, lambda: None)
    waiting.run(lambda: state.run(SimpleNamespace(goal=GOAL)))
    assert profiles == [] and state.reason == "primitive 'reach_human' toward object_mug_ahead"
    waiting.ctx.config.set("approach_profile", "dmp_compliant")
    waiting.run(lambda: state.run(SimpleNamespace(goal=GOAL)))
    assert profiles == ["dmp_compliant"]
