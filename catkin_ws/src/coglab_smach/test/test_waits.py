"""Time limits of states, their published waits, the result of each kind of end, and the end of a motion."""

import numpy as np
import pytest
import smach
from coglab_msgs.msg import ReasonCode
from coglab_smach.context.config import ConfigError
from coglab_smach.kinematics.motion_time import MotionLimits
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError, Ready
from coglab_smach.states.base import CoglabState, require_all
from coglab_smach.states.motion import await_rest, end_motion, rise, shift, shift_time
from coglab_trials.virtual_clock import using
from conftest import Trial

NEVER = lambda: False  # noqa: E731


class Probe(CoglabState):
    """Runs the test's function."""

    def __init__(self, ctx, work):
        super().__init__(ctx, ["succeeded", "other"])
        self.work = work

    def run(self, ud):
        return self.work(self) or "succeeded"


class Never(Pending):
    """A call that is never answered."""

    cancelled = 0

    def done(self):
        return False

    def cancel(self):
        self.cancelled += 1


def walked(work, prepare=lambda trial, state: None, **flags):
    """Returns (trial, state, its record, duration in s)."""
    trial = Trial()
    state = Probe(trial.ctx, work)
    for name, value in flags.items():
        setattr(state, name, value)
    prepare(trial, state)
    with using(trial.clock):
        begin = trial.clock.now()
        outcome = state.execute(smach.UserData())
    record = trial.ctx.journal.transitions[-1]
    assert record.outcome == outcome
    return trial, state, record, trial.clock.now() - begin


@pytest.mark.parametrize(
    ("limit", "own", "took"), [(2.0, 10.0, 2.0), (None, 10.0, 10.0), (20.0, 10.0, 10.0), (0.0, 10.0, 0.0)]
)
def test_a_wait_ends_at_its_own_limit_or_the_states(limit, own, took):
    _, _, record, seconds = walked(lambda s: s.wait_for(NEVER, "rain", limit), default_time_limit=own)
    assert took <= seconds <= took + 0.021
    assert (record.outcome, record.code) == ("failed", ReasonCode.TIME_LIMIT)
    assert "rain" in record.reason and f" {took:.1f} s" in record.reason


@pytest.mark.parametrize(("pace", "took"), [(1.0, 2.0), (0.5, 4.0), (0.0, 20.0), (0.1, 20.0), (3.0, 2.0)])
def test_the_limit_of_a_wait_for_a_motion_follows_its_pace_down_to_a_tenth(pace, took):
    left = []

    def work(state):
        try:
            state.wait_for(NEVER, "rain", 2.0, lambda: pace)
        finally:
            left.append(state.left())

    _, _, _, seconds = walked(work)
    assert seconds == pytest.approx(took, abs=0.15) and left[0] == pytest.approx(8.0, abs=0.1), "extended likewise"


def test_only_a_call_without_an_answer_is_cancelled():
    never, good = Never(), Ready(5)
    good.cancel = lambda: pytest.fail("it was answered")
    _, _, record, seconds = walked(lambda s: s.await_pending(never, "the answer", 1.5))
    assert never.cancelled == 1 and "the answer" in record.reason and "1.5 s" in record.reason
    assert seconds == pytest.approx(1.5, abs=0.02)
    assert walked(lambda s: str(s.await_pending(good, "it")) == "5" and "other")[2].outcome == "other"


@pytest.mark.parametrize("configured", [False, True])
def test_the_configured_time_limit_wins_over_the_states_own(configured):
    def prepare(trial, state):
        trial.ctx.config.set("time_limits", {"Probe": 3.0} if configured else {})

    def work(state):
        state.pause(1.0)
        state.allow(20.0)
        state.wait_for(NEVER, "rain")

    _, _, _, seconds = walked(work, prepare)
    assert seconds == pytest.approx(3.0 if configured else 21.0, abs=0.03)


def raising(error):
    def work(state):
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "sentence", "code"),
    [
        (PortError("no", ("because",), 7), "Probe: no", 7),
        (ConfigError("no field"), "Probe: no field", ReasonCode.BAD_FILE),
        (smach.InvalidUserCodeError("no key"), "Probe: no key", ReasonCode.BAD_FILE),
        (ValueError("odd"), "Probe: ValueError: odd (test_waits.py:", ReasonCode.UNEXPECTED),
    ],
)
def test_any_exception_of_a_state_is_a_failure_with_sentence_and_code(error, sentence, code):
    trial, _, record, _ = walked(raising(error))
    assert record.outcome == "failed" and record.reason.startswith(sentence) and record.code == code
    first = trial.ctx.journal.first_failure()
    assert (first.sentence, first.causes, first.code) == (record.reason, record.causes, code)


@pytest.mark.parametrize(("deaf", "outcome"), [(False, "failed"), (True, "succeeded")])
def test_stop_ends_a_state_unless_it_ignores_stop(deaf, outcome):
    def prepare(trial, state):
        state.trial = trial

    def work(state):
        state.trial.ctx.stop.press("the test")
        state.pause(1.0)

    _, _, record, seconds = walked(work, prepare, ignores_stop=deaf)
    assert record.outcome == outcome and seconds == pytest.approx(1.0 if deaf else 0.0)
    if not deaf:
        assert "the test" in record.reason
        assert record.code == ReasonCode.STOP_LATCHED


def test_a_preemption_is_served_during_a_wait_and_at_the_end():
    for work in (lambda s: s.request_preempt() or s.pause(1.0), lambda s: s.request_preempt() or "other"):
        _, state, record, seconds = walked(work)
        assert (record.outcome, record.code, seconds) == ("preempted", ReasonCode.PREEMPTED, 0.0)
        assert not state.preempt_requested(), "the request is served"
    _, state, record, _ = walked(lambda s: s.request_preempt() or "failed")
    assert record.outcome == "failed" and state.preempt_requested(), "the container passes it on"


@pytest.mark.parametrize(("outcome", "cancelled"), [("succeeded", 0), ("failed", 1)])
def test_a_failed_state_ends_the_motion_that_it_owns(outcome, cancelled):
    trial, _, _, _ = walked(lambda s: outcome, owns_motion=True)
    assert len(trial.cell.called("cancel")) == cancelled
    assert not walked(lambda s: "failed")[0].cell.called("cancel")


@pytest.mark.parametrize(
    ("first", "second", "over", "end"),
    [
        (None, None, False, None),
        ("succeeded", None, False, None),
        ("failed", None, True, None),
        ("preempted", None, True, None),
        ("succeeded", "succeeded", True, "succeeded"),
        ("succeeded", "failed", True, "failed"),
        ("preempted", "failed", True, "failed"),
        ("succeeded", "preempted", True, "preempted"),
    ],
)
def test_a_group_ends_when_all_have_succeeded_or_one_has_failed(first, second, over, end):
    decide, conclude = require_all(["a", "b"])
    outcomes = {"a": first, "b": second, "looks on": "failed"}
    assert decide(outcomes) == over
    assert end is None or conclude(outcomes) == end


# --- the end of a motion ----------------------------------------------------------------------------------------------


def rested(sway, look=lambda: None):
    """Returns the wait (s) for an arm that sways by ``sway(s)`` rad."""
    trial = Trial()
    trial.ctx.arm.joint_positions = lambda: (0.0, sway(trial.clock.now()), *[0.0] * 5)
    with using(trial.clock):
        await_rest(trial.ctx, look)
    return trial.clock.now()


def test_an_arm_that_moves_less_than_1_mrad_in_200_ms_is_at_rest():
    assert rested(lambda t: 0.0) == pytest.approx(0.2, abs=0.011)
    assert rested(lambda t: 0.0009 * (t > 0.1)) == pytest.approx(0.2, abs=0.011)
    assert rested(lambda t: 0.0011 * (t > 0.095)) == pytest.approx(0.3, abs=0.011)
    assert rested(lambda t: -0.01 * t) == pytest.approx(1.5, abs=0.021), "1 mrad in 0.1 s: the wait ends after 1.5 s"
    assert rested(lambda t: 0.0, lambda: True) == 0.0
    looks = []
    assert rested(lambda t: 0.1 * t, lambda: looks.append(1) or len(looks) > 10) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("there", "hold", "took", "words"),
    [
        (True, "succeeds", 3.2, (" 3.0 s", "held")),
        (True, "refuses", 3.2, (" 3.0 s", "held already")),
        (False, "succeeds", 0.5, ("silent",)),
    ],
)
def test_the_arm_is_held_if_cancelling_fails_and_a_silent_robot_ends_the_wait(there, hold, took, words):
    trial, held = Trial(), []
    refusal = Ready(error=PortError("held already"))
    trial.ctx.arm.cancel_motion = lambda reason: Never()
    trial.ctx.arm.hold = lambda reason: held.append(reason) or (Ready() if hold == "succeeds" else refusal)
    if not there:
        trial.ctx.arm.joint_positions = lambda: None
    with using(trial.clock):
        trouble = end_motion(trial.ctx, "the test")
    assert all(word in trouble for word in words), trouble
    assert trial.clock.now() == pytest.approx(took, abs=0.04)
    assert len(held) == there


@pytest.mark.parametrize("by", [(0.0, 0.0, 0.05), (0.03, -0.02, 0.01)])
def test_a_shift_moves_the_palm_straight_and_each_joint_by_its_share(by):
    trial, asked = Trial(), []
    here = np.array(trial.ctx.config.get("postures.home"))
    trial.ctx.arm.joint_positions = lambda: tuple(here)
    trial.ctx.arm.move_ptp = lambda target, speed: asked.append((np.array(target), np.array(speed))) or Ready()
    shift(trial.ctx, np.array(by), 0.04)
    ((target, speed),) = asked
    (before, turn), (after, turned) = default_arm().fk(here), default_arm().fk(target)
    assert after - before == pytest.approx(by, abs=5e-3) and abs(turn @ turned) > 0.9999
    # Duration: path length over speed. The smallest commanded joint speed is 1 mrad/s.
    seconds = float(np.linalg.norm(by)) / 0.04
    assert speed == pytest.approx(np.maximum(np.abs(target - here) / seconds, 1e-3))
    assert shift_time(trial.ctx, np.array(by), 0.04) >= seconds
    slow = MotionLimits((0.01,) * 7, (1.0,) * 7, (1.0,) * 7, (1.0,) * 7)
    trial.ctx.arm.motion_limits = lambda: slow
    shift(trial.ctx, np.array(by), 0.04)
    assert asked[1][1] == pytest.approx(speed * 0.01 / speed.max()), "all alike"
    rise(trial.ctx, -0.02, 0.04)
    assert default_arm().fk(asked[2][0])[0] - before == pytest.approx([0.0, 0.0, -0.02], abs=2e-3)
    trial.ctx.arm.joint_positions = lambda: None
    assert shift(trial.ctx, np.array(by), 0.04) is None and shift_time(trial.ctx, np.array(by), 0.04) == 0.0
