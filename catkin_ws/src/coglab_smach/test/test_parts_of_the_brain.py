"""Parts of the brain one by one: what is remembered and configured, triggers and the journal, how the machines are put
together, and states that wait for the operator or begin a motion."""

import json
import os
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.contact.learning import MotionRecorder
from coglab_smach.context.holding import HoldingMemory
from coglab_smach.context.journal import Failure, Journal, TransitionRecord
from coglab_smach.context.requests import Requests, command
from coglab_smach.context.trigger import ask_for
from coglab_smach.kinematics.reachability import default_arm, home_posture, joint_limits, solve
from coglab_smach.ports.interfaces import Verdict
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states.arm import ConfigureLwr, PtpMotion
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.hub import WaitForTrigger
from coglab_trials.virtual_clock import ClockStalled, VirtualClock, VirtualCondition, using
from conftest import Trial
from test_node_parts import script

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"

# --- memory and configuration -----------------------------------------------------------------------------------------


def test_what_is_held_is_noted_whole_and_read_again(tmp_path, monkeypatch):
    path, warnings = tmp_path / "a" / "b" / "holding.json", []
    memory = HoldingMemory(str(path), warnings.append)
    assert memory.recall() == "" and warnings == []
    memory.note("mug")
    assert memory.recall() == "mug" and os.listdir(path.parent) == ["holding.json"]
    for text in ("[]", "{}", "{"):
        path.write_text(text)
        assert memory.recall() == ""
    assert len(warnings) == 3
    HoldingMemory(str(tmp_path / "a"), warnings.append).note("mug")
    assert "cannot be written" in warnings[3]
    HoldingMemory().note("mug")
    assert HoldingMemory().recall() == ""
    module, shown = script("master_node"), []
    monkeypatch.setattr(module.rospy, "Publisher", lambda name, kind, queue_size, latch: (name, latch))
    monkeypatch.setattr(module, "publish", lambda to, message: shown.append((to, message.data)))
    module.Memory(str(path), warnings.append).note("ball")
    assert json.loads(path.read_text()) == {"object_id": "ball"} and shown == [(("coglab/holding", True), "ball")]


# --- triggers and the journal -----------------------------------------------------------------------------------------


def test_a_trigger_is_taken_once_and_a_new_hub_forgets_it():
    changes = []
    requests = Requests(lambda: changes.append(1))
    assert requests.submit("a").code == ReasonCode.WRONG_STATE and requests.default_object is None
    requests.open("hub", ["a", "b"], default_object="mug")
    assert (requests.hub(), requests.allowed(), requests.default_object) == ("hub", ("a", "b"), "mug")
    answer = requests.submit("a", "ball", "me")
    assert answer == (True, "'a' accepted by hub", 0) and requests.submit("b").code == ReasonCode.BUSY
    taken = requests.take()
    assert (taken.action, taken.object_id, taken.source) == ("a", "ball", "me") and requests.take() is None
    requests.submit("a")
    requests.open("other", ["a"], names_object=True)
    assert requests.take() is None and requests.submit("a").code == ReasonCode.OBJECT_UNKNOWN
    assert requests.submit("a", "mug").ok
    requests.close()
    assert (requests.hub(), requests.allowed(), requests.take(), len(changes)) == ("", (), None, 3)
    assert command("a", "b") == "type: ./coglab start a or ./coglab start b"


def test_a_trigger_waits_two_seconds_for_the_database():
    for after, ok in ((1.9, True), (2.1, False)):
        trial = Trial()
        clock = trial.clock
        trial.ctx.database.list_objects = lambda clock=clock, after=after: Polled(
            lambda: clock.now() >= after, lambda: ["mug"], lambda: None
        )
        trial.ctx.requests.open("hub", ["take"], default_object="mug")
        with using(clock):
            answer = ask_for(trial.ctx, "take")
        assert answer.ok == ok and clock.now() == pytest.approx(min(after, 2.0), abs=0.011)
        assert ok or answer.code == ReasonCode.NODE_SILENT


def test_words_of_the_journal():
    record = TransitionRecord(1.0, "/m", "a", "failed", "b", "why", ("x", "y"))
    assert record.sentence() == "/m/a -[failed]-> b: why <- x <- y"
    assert TransitionRecord(1.0, "/m", "a", "done", "b", "").sentence() == "/m/a -[done]-> b"
    assert str(Failure("why", ("x", "y"))) == "why, because x, because y" and str(Failure()) == ""
    journal = Journal(lambda: 5.0)
    assert journal.why() == "Nothing has failed since the last success or reset."
    assert not journal.marked("a")
    journal.begin_action("take", "mug")
    journal.mark("a")
    assert journal.marked("a") and not journal.marked("b")
    journal.failure("first", ("x",), 3)
    journal.failure("second", (), 4)
    assert journal.first_failure() == Failure("first", ("x",), 3) == journal.newest_failure()
    journal.stopped("the arm is blocked: held", "held", 7)
    assert journal.newest_failure() == Failure("the arm is blocked: held", ("first", "x"), 7)
    journal.stopped("again: held", "held", 8)
    assert journal.newest_failure().code == 7, "named already"
    journal.stopped("yet again", "x", 9)
    assert journal.newest_failure().code == 7, "in a cause, too"
    journal.end_action("stopped")
    result = journal.results[0]
    assert (result.outcome, result.code, result.ended, result.started) == ("stopped", 7, 5.0, 5.0)
    journal.settle()
    assert journal.first_failure() == Failure() and journal.newest_failure().code == 7
    journal.settle(forget=True)
    assert journal.newest_failure() == Failure()
    journal.end_action("succeeded")
    assert len(journal.results) == 1, "none was begun"


# --- how the machines are put together --------------------------------------------------------------------------------


def test_who_goes_beside_the_arm_in_each_reach(trial):
    groups = {
        (RECEIVE, "approach"): {"arm_motion", "hand_preshape", "monitor_dmp"},
        (GIVE, "approach"): {"arm_motion", "monitor_dmp"},
        ("take", "precise_motion"): {"arm_motion"},
        ("put", "precise_motion"): {"arm_motion"},
    }
    machines = trial.master.get_children()
    for (action, group), children in groups.items():
        assert set(machines[action].get_children()[group].get_children()) == children
    during = Trial(**{"take.preshape": "during"}).master.get_children()["take"].get_children()
    assert set(during["precise_motion"].get_children()) == {"arm_motion", "hand_preshape"}


def test_what_states_are_for_in_each_action(trial):
    actions = trial.master.get_children()
    state = lambda action, label: actions[action].get_children()[label]  # noqa: E731
    assert state(RECEIVE, "coglab_home_robot").carries and not state(RECEIVE, "coglab_home_robot").gave
    assert state(GIVE, "coglab_home_robot").gave and not state(GIVE, "coglab_home_robot").carries
    for action in ("take", "put"):
        home = state(action, "coglab_home_robot")
        assert not home.carries and not home.gave
    assert state(RECEIVE, "hand_close").from_person and not state("take", "hand_close").from_person
    assert state(RECEIVE, "tighten_at_home").at_home and not state(RECEIVE, "hand_tighten").at_home
    assert not actions["wait_without_object"].with_object and actions["wait_with_object"].with_object
    for name, operator in (("recover", True), *[(action, False) for action in (RECEIVE, GIVE, "take", "put")]):
        recover = actions[name] if operator else state(name, "recover")
        assert recover.get_children()["secure_hand"].operator == operator
        assert recover.get_children()["tighten_at_home"].at_home
    records = {name: child.is_action for name, child in actions.items() if hasattr(child, "is_action")}
    assert {name for name, is_one in records.items() if is_one} == {RECEIVE, GIVE, "take", "put", "coglab_init_system"}


def test_what_was_taken_from_the_board_is_held_as_its_grasp_says_and_named_again_it_is_the_same(trial):
    def walk(t):
        t.wait_hub("wait_without_object")
        t.grip.firm = 140
        t.start("take")
        t.wait_hub("wait_with_object")
        assert t.grip.firm == 0 and not t.grip.shared
        t.start("put", "mug")
        t.wait_hub("wait_without_object")

    trial.run(walk)
    reasons = [t.reason for t in trial.ctx.journal.transitions if t.from_state == "wait_with_object"]
    assert reasons[0] == "operator asked for put of 'mug'"


# --- states -----------------------------------------------------------------------------------------------------------


def ran(trial, state, **ud):
    """Its outcome and the s that it took."""
    state._deadline = trial.clock.now() + state.time_limit()
    with using(trial.clock):
        begin = trial.clock.now()
        return state.run(SimpleNamespace(**ud)), trial.clock.now() - begin


def test_a_robot_controller_that_refuses_is_asked_again_each_second_until_two_are_left():
    trial, asked = Trial(), []
    clock = trial.clock
    trial.ctx.arm.motion_allowed = lambda: Verdict(False, "why", 9)
    trial.ctx.arm.lwr_command = lambda event: asked.append((event, clock.now())) or Ready(error=PortError("no"))
    with pytest.raises(PortError, match="no"):
        ran(trial, ConfigureLwr(trial.ctx))
    assert {event for event, _ in asked} == {"position"} and np.diff([t for _, t in asked]) == pytest.approx(
        1.0, abs=0.011
    )
    assert clock.now() == pytest.approx(43.0, abs=1.1) and 45.0 - clock.now() < 2.0
    trial.ctx.arm.lwr_command = lambda event: asked.append((event, 0.0)) or Ready("done")
    asked.clear()
    with pytest.raises(TimeLimit) as error:
        ran(trial, ConfigureLwr(trial.ctx))
    assert [event for event, _ in asked] == ["position", "start"] and error.value.causes == ("why",)
    assert error.value.code == 9
    trial.ctx.arm.motion_allowed = lambda: Verdict(True)
    asked.clear()
    assert ran(trial, ConfigureLwr(trial.ctx)) == ("succeeded", 0.0) and asked == []


def test_a_way_may_take_half_as_long_again_and_five_seconds():
    trial = Trial()
    state, allowed = PtpMotion(trial.ctx, "board"), []
    home = trial.ctx.config.get("postures.home")
    trial.ctx.arm.joint_positions = lambda: (
        tuple(home) if not allowed else tuple(trial.ctx.config.get("postures.board"))
    )
    trial.ctx.arm.switch_controller = trial.ctx.arm.move_ptp = lambda *a: Ready()
    state.allow = allowed.append
    ran(trial, state)
    limits, board = trial.ctx.arm.motion_limits(), np.array(trial.ctx.config.get("postures.board"))
    speed, way = np.array(limits.ptp_velocity), np.abs(board - home)
    longest = float(np.max(way / speed + speed / np.array(limits.ptp_acceleration)))
    assert allowed == [pytest.approx(5.0 + 1.5 * longest), 1.5]


@pytest.mark.parametrize(("holds", "code", "tries"), [(2, 405, 3), (9, 405, 4), (9, 403, 1)])
def test_motion_home_is_resumed_once_the_person_has_let_go(holds, code, tries):
    """The person holds the arm for ``holds`` tries. 405: it did not come to its target; 403: a joint is at its stop."""
    trial = Trial()
    state, begun, home = PtpMotion(trial.ctx, "home"), [], trial.ctx.config.get("postures.home")
    trial.ctx.arm.joint_positions = lambda: tuple(home)
    trial.ctx.arm.switch_controller = lambda *a: Ready()

    def move_ptp(*_):
        begun.append(trial.clock.now())
        return Ready(error=PortError("ended before its target", code=code) if len(begun) <= holds else None)

    trial.ctx.arm.move_ptp = move_ptp
    if tries > holds:
        assert ran(trial, state)[0] == "succeeded"
    else:
        with pytest.raises(PortError) as error:
            ran(trial, state)
        assert error.value.code == code
    assert len(begun) == tries and all(b - a >= 1.0 for a, b in zip(begun, begun[1:], strict=False))


def test_the_go_ahead_is_waited_for_an_hour_unless_it_is_given_beforehand():
    trial = Trial(auto_trigger=False)
    with pytest.raises(TimeLimit):
        ran(trial, WaitForTrigger(trial.ctx))
    assert trial.clock.now() == pytest.approx(3600.0, abs=0.1) and trial.ctx.requests.hub() == ""
    state = WaitForTrigger(Trial().ctx)
    assert ran(Trial(), state)[0] == "succeeded" and state.reason == "auto_trigger is set"


# --- a recorder, a descent and a clock --------------------------------------------------------------------------------


@pytest.mark.parametrize(("samples", "speed", "kept"), [(40, 0.11, 1), (39, 0.11, 0), (60, 0.09, 0)])
def test_a_motion_counts_with_40_samples_and_a_tenth_of_a_radian_per_second(samples, speed, kept):
    moving = SimpleNamespace(change=None, load=0.0, still=lambda: False, offset_of_motion=lambda: "offset")
    recorder = MotionRecorder(moving)
    recorder.look()
    for k in range(samples):
        moving.change = SimpleNamespace(stamp=1.0 + k, features=np.full((7, 6), speed))
        recorder.look()
        recorder.look()
    recorder.end()
    assert (len(recorder.reaches), len(recorder.offsets)) == (kept, kept)
    assert not kept or len(recorder.reaches[0]) == samples, "each sample once"
    moving.load = 0.3
    for k in range(60):
        moving.change = SimpleNamespace(stamp=100.0 + k, features=np.full((7, 6), 0.2))
        recorder.look()
    recorder.end()
    assert (len(recorder.reaches), len(recorder.offsets)) == (kept + 1, kept), "a load leaves an offset of its own"


def test_of_a_rest_the_last_40_samples_belong_to_the_motion_and_4000_are_kept():
    rests = [True]
    moving = SimpleNamespace(change=None, load=0.0, still=lambda: rests[0], offset_of_motion=lambda: None)
    recorder = MotionRecorder(moving)

    def feed(count, speed):
        for _ in range(count):
            stamp = 1.0 if moving.change is None else moving.change.stamp + 1.0
            moving.change = SimpleNamespace(stamp=stamp, features=np.full((7, 6), speed))
            recorder.look()

    feed(100, 0.0)
    rests[0] = False
    feed(50, 0.2)
    rests[0] = True
    feed(1, 0.0)
    assert [len(reach) for reach in recorder.reaches] == [91] and recorder.offsets == []
    rests[0] = False
    feed(4100, 0.2)
    assert [len(reach) for reach in recorder.reaches] == [91, 4000]


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_no_posture_that_is_found_is_nearer_to_the_end_of_a_range_than_a_fiftieth_of_it(joint, side):
    arm, end = default_arm(), 0.98 * np.asarray(joint_limits().upper_position)
    start, beyond = home_posture().copy(), home_posture().copy()
    start[joint], beyond[joint] = 0.96 * side * end[joint] / 0.98, 0.995 * side * end[joint] / 0.98
    found = solve(arm, Pose(*arm.fk(beyond)), start)
    assert found is None or np.all(np.abs(found) <= end + 1e-9)


def test_a_clock_that_stalls_names_who_runs_and_who_waits():
    clock = VirtualClock(5.0, stall_limit=0.5)
    assert clock.now() == 5.0
    with clock.attached():
        event = clock.event()
        waiter = clock.start_thread(lambda: pytest.raises(ClockStalled, event.wait), "waiter", daemon=True)
        clock.sleep(1.0)
        with pytest.raises(ClockStalled) as error:
            clock.event().wait()
    assert "at 6.000000 s for 0.5 s of wall time: nobody is running" in str(error.value)
    waiter.join(5)
    with using(VirtualClock()) as other:
        event = other.event()
        other.start_thread(lambda: (other.sleep(0.5), event.set(), event.clear()), "pulse")
        assert event.wait(9.0) is True and not event.is_set(), "who waited was woken"
        other.sleep(-0.5)
        condition = VirtualCondition(other)
        other.start_thread(lambda: (other.sleep(2.0), condition.notify_all()), "n")
        with condition:
            assert condition.wait() is True and other.now() == 2.5
