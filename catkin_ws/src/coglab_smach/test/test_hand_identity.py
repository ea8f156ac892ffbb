"""Two hands in reach: another hand releases no object and starts no firm closing."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import Ahead
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states import reach, weight
from coglab_smach.states.hand_tracking import HandTrack
from coglab_smach.states.weight import person_holds
from coglab_trials.virtual_clock import using
from conftest import Trial
from test_giving import WEIGHT, giving
from test_weight_and_recovery import Lifted

RECEIVE = "exchange_human_to_robot"
FRAME = 1.0 / 30.0
HERE, THERE = np.array([0.9, 0.0, 0.4]), np.array([0.9, 0.45, 0.4])


def palm_of(trial):
    """m."""
    return default_arm().fk(np.asarray(trial.cell.arm.position()))[0]


def follow(track, frames, place, near=True):
    for k in frames:
        track.follow(k * FRAME, place, near)


def receive(trial, moment, then, limit=60.0):
    """Request the mug and call ``then`` when ``moment`` is true. Returns the action's record."""

    def script(t):
        t.wait_hub("wait_without_object")
        before = len(t.ctx.journal.results)
        t.start(RECEIVE)
        t.until(lambda: moment(t))
        then(t)
        t.until(lambda: len(t.ctx.journal.results) > before, limit)

    trial.run(script)
    return trial.result()


def test_a_hand_that_reappears_elsewhere_may_be_another_one():
    track = HandTrack()
    follow(track, range(10), HERE)
    assert track.is_one and track.is_sure
    follow(track, range(17, 40), THERE, near=False)
    assert track.is_one and not track.is_sure, "the hand may have moved there, but unseen"
    follow(track, range(40, 60), THERE + [0.0, 0.1, 0.0])
    assert not track.is_sure, "it stays unsure during its motion"
    follow(track, range(70, 72), HERE + [0.0, 0.05, 0.0])
    assert track.is_sure, "back where it was"


def test_a_hand_tracked_without_a_gap_is_sure_at_any_distance():
    track = HandTrack()
    for k in range(60):
        track.follow(k * FRAME, HERE + [1.2 * k * FRAME, 0.0, 0.0], k < 5)
        assert track.is_sure


def test_a_hand_that_was_never_seen_at_the_object_is_not_sure():
    track = HandTrack()
    follow(track, range(10), THERE, near=False)
    assert track.is_one and not track.is_sure
    follow(track, range(10, 12), HERE)
    assert not track.is_one, "another hand"
    follow(track, range(20, 22), THERE, near=True)
    assert track.is_one and track.is_sure


@pytest.mark.parametrize("swap", [0.13, 0.4])
def test_a_hand_is_sure_again_at_its_place_after_a_lost_sight(swap):
    track = HandTrack()
    follow(track, range(10), HERE)
    follow(track, range(10, 14), HERE + [0.0, swap, 0.0])
    assert not track.is_sure or not track.is_one
    follow(track, range(15, 17), HERE)
    assert track.is_one and track.is_sure


def test_a_hand_is_sure_again_at_its_place_after_another_hand_appeared():
    track = HandTrack()
    follow(track, range(10), HERE)
    follow(track, range(20, 24), HERE + [0.0, 0.13, 0.0])
    assert track.is_one and not track.is_sure, "it was hidden, and may have gone there"
    follow(track, range(24, 26), HERE)
    assert track.is_one and track.is_sure


def test_another_hand_starts_no_firm_closing_while_the_person_holds_on():
    trial, firm = Trial(), []
    close = trial.ctx.hand.close
    trial.ctx.hand.close = lambda speed: (firm.append(speed) if speed > 60 else None) or close(speed)
    trial.cell.partner.let_go_after = trial.cell.partner.take_after = None

    def other_hand(t):
        t.clock.sleep(0.2)
        t.cell.faults.not_seen.add("human_hand")
        t.clock.sleep(0.3)
        t.cell.objects["human_hand"] = Pose(np.asarray(t.cell.objects["human_hand"].position) + [0.1, 0.5, 0.0])
        t.cell.faults.not_seen.discard("human_hand")
        t.clock.sleep(4.0)
        assert not firm and not t.ctx.journal.marked("released")
        t.cell.partner.take_after = 0.5  # the arm sinks, and the person holds the object

    result = receive(trial, lambda t: "arm lift" in t.cell.called(), other_hand)
    assert (result.outcome, result.code) == ("stopped", ReasonCode.NOT_RELEASED) and not firm


@pytest.mark.parametrize("weight", [True, False])
def test_a_hand_that_left_hidden_has_let_go_only_with_the_weight(weight):
    trial = Trial()
    trial.cell.partner.let_go_after = trial.cell.partner.take_after = None

    def goes_hidden(t):
        t.cell.faults.not_seen.add("human_hand")
        t.clock.sleep(0.5)
        t.cell.objects["human_hand"] = Pose(palm_of(t) + [0.45, 0.0, 0.0])
        t.cell.faults.not_seen.discard("human_hand")
        t.clock.sleep(0.3)
        if weight:
            t.cell.push(-WEIGHT)

    result = receive(trial, lambda t: "arm lift" in t.cell.called(), goes_hidden)
    assert result.outcome == ("succeeded" if weight else "stopped"), result


def test_the_robot_does_not_wait_for_a_person_who_let_go_before_closing(monkeypatch):
    trial = Trial()
    trial.cell.partner.let_go_after, trial.cell.let_go = None, lambda: None
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)

    def goes(t):
        t.cell.goes = t.clock.now(), palm_of(t) + [0.45, 0.0, 0.0]
        t.cell.bring = lambda object_id, palm: setattr(t.cell, "at_palm", (object_id, palm))
        t.until(lambda: "arm lift" in t.cell.called())
        t.clock.sleep(0.15)
        t.cell.push(-WEIGHT)

    result = receive(trial, lambda t: t.ctx.journal.marked("closing_on_the_way"), goes)
    assert result.outcome == "succeeded", result


def tells_late(hand, clock, late):
    """The hand reports its grip ``late`` s after the end of the closing order."""
    close, state, ended = hand.close_on_object, hand.state, []

    def closing():
        order = close()
        done = lambda: order.done() and (ended or ended.append(clock.now()) or True)  # noqa: E731
        return Polled(lambda: bool(done()), order.result, order.cancel)

    hand.close_on_object = closing
    hand.state = lambda: replace(state(), holding=bool(ended) and clock.now() >= ended[0] + late and state().holding)


@pytest.mark.parametrize(("touched", "seen_after"), [(False, 1.5), (True, 1.5), (False, 0.6)])
def test_fingers_that_caught_the_object_do_not_open_when_it_is_seen_again(monkeypatch, touched, seen_after):
    """The person lets go at the first touch. The object in the robot's fingers is seen again after a pause."""
    trial, opened = Trial(**{"handover.belief": 0.5}), []
    tells_late(trial.ctx.hand, trial.clock, 0.1)
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)
    # The reach begins on a belief, which is gone afterwards.
    offered = trial.cell.objects["mug"]
    trial.cell.objects["mug"] = Pose(offered.position + [0.7, 0.0, 0.0])
    belief = Ahead(1.0, 0.0, "mug", "object_mug_ahead", tuple(map(float, offered.position)))
    trial.ctx.perception.ahead = lambda: Ahead() if trial.ctx.journal.marked("motion_started") else belief
    trial.cell.partner.touch_after, trial.cell.partner.take_after = (1.2 if touched else None), None
    preshape = trial.ctx.hand.preshape

    def watched(mode, level):
        opened.extend([mode] if trial.cell.at_palm is not None else [])
        return preshape(mode, level)

    trial.ctx.hand.preshape = watched

    def lets_go(t):
        t.cell.objects["mug"] = offered
        t.until(lambda: t.ctx.journal.marked("closing_on_the_way"))
        # The object stays at its place, within the region.
        t.cell.at_palm = ("mug", t.cell.objects["mug"].inverse() * Pose(*default_arm().fk(t.cell.arm.position())))
        t.cell.goes = t.clock.now(), np.array([1.6, 0.0, 0.4])
        t.cell.faults.not_seen.add("mug")
        t.clock.sleep(seen_after)
        t.cell.faults.not_seen.discard("mug")

    result = receive(trial, lambda t: t.ctx.journal.marked("motion_started"), lets_go)
    assert "paused" in result.marks and not opened, result
    assert "contact" in result.marks, "a held object counts as contact, even if none was detected"


def test_another_hand_does_not_release_an_object_caught_during_the_reach(monkeypatch):
    trial = Trial()
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: 0.02)
    trial.cell.partner.touch_after = None

    def jumps(t):
        t.cell.bring("mug", Pose([-0.05, 0.0, 0.0]))
        t.clock.sleep(0.5)
        t.cell.objects["human_hand"] = Pose(palm_of(t) + [0.2, 0.62, 0.0])
        t.cell.arm.end("goal lost", ReasonCode.GOAL_LOST)

    result = receive(trial, lambda t: t.ctx.journal.marked("closing_on_the_way"), jumps)
    assert result.outcome == "stopped" and trial.grip.shared and not trial.cell.called("open")


def test_another_hand_does_not_move_the_arm_while_the_taker_holds_the_object():
    def script(t):
        t.cell.goes = t.clock.now(), palm_of(t) + [0.1, 0.0, 0.0]
        t.clock.sleep(0.5)
        t.cell.push(0.45 * WEIGHT)
        t.clock.sleep(1.0)
        assert t.grip.shared
        t.cell.objects["human_hand"] = Pose(palm_of(t) + [0.2, 0.62, 0.0])
        t.wait_hub("stopped")

    assert giving(script).result().outcome == "stopped"


@pytest.mark.parametrize("holds", [True, False])
@pytest.mark.parametrize("hand", ["near", "hidden", "gone"])
def test_a_grip_on_a_light_object_is_measured_before_the_arm_moves(hand, holds):
    """At rest, the person's share of a light load may be too small to measure."""

    def script(t):
        t.cell.partner.take_after = None
        t.cell.goes = t.clock.now(), palm_of(t) + [0.1, 0.0, 0.0]
        t.clock.sleep(3.0)
        if hand == "hidden":
            t.cell.faults.not_seen.add("human_hand")
        if hand == "gone":
            t.cell.goes = t.clock.now(), palm_of(t) + [0.9, 0.0, 0.0]
        t.clock.sleep(3.0)
        t.cell.partner.take_after = 0.5 if holds else None
        t.until(lambda: t.ctx.requests.hub() in ("stopped", "wait_with_object"), 60.0)

    result = giving(script, **{"give.near": 0.01}).result()
    # For a hand that was seen to leave, nothing is measured.
    assert result.outcome == ("stopped" if hand != "gone" and holds else "failed_holding")


@pytest.mark.parametrize("trouble", ["refuses", "silent", "the arm stands", ""])
def test_a_failed_measurement_does_not_mean_that_nobody_holds(monkeypatch, trouble):
    lifted = Lifted(monkeypatch)
    lifted.state.allow(1e9)
    contact = lifted.ctx.contact
    contact.share_gone = lambda: None if trouble == "silent" else 0.0
    if trouble == "refuses":
        contact.arm = lambda *_: Ready(error=PortError("no torques come"))
    if trouble == "the arm stands":
        monkeypatch.setattr(weight, "rise", lambda *_: Ready(error=PortError("refused")))
    with using(lifted.trial.clock):
        assert person_holds(lifted.state, {"mass": 0.31, "load_share": 0.5}) is (None if trouble else False)


@pytest.mark.parametrize("perception", ["seen", "silent"])
def test_yielding_during_closing_does_not_wait_for_a_sight(perception):
    trial, took = Trial(), []
    trial.cell.partner.let_go_after = None

    def pulls(t):
        t.clock.sleep(0.3)
        if perception == "silent":
            t.cell.faults.dead.add("perception")
        t.clock.sleep(0.1)
        t.cell.pulled, begun = (12.0, 0.0, 0.0), t.clock.now()
        t.until(lambda: t.ctx.journal.marked("gave_way"))
        took.append(t.clock.now() - begun)
        t.ctx.stop.press("enough")

    receive(trial, lambda t: t.ctx.journal.marked("closing"), pulls)
    assert took[0] < 0.1


def test_an_object_falling_beside_the_persons_hand_was_not_taken_back():
    trial = Trial()
    trial.cell.partner.let_go_after = None

    def falls(t):
        t.clock.sleep(0.3)
        start, begun = np.asarray(t.cell.pose("mug").position), t.clock.now()
        t.cell.at_palm, t.cell.hand_positions = None, (200, 254, 254, 254, 254)
        while t.ctx.requests.hub() == "" and t.clock.now() < begun + 5.0:
            drop = 4.9 * (t.clock.now() - begun) ** 2
            t.cell.objects["mug"] = Pose([start[0], start[1], max(-0.4, start[2] - drop)])
            t.clock.sleep(0.01)

    result = receive(trial, lambda t: "arm lift" in t.cell.called(), falls)
    assert (result.outcome, result.code) == ("failed_empty", ReasonCode.OBJECT_NOT_SEEN), result


def test_stop_ends_the_closing_during_the_first_look_at_the_person():
    trial, begun, cancelled = Trial(), [], []
    trial.ctx.hand.close_on_object = lambda: (
        begun.append(1) or Polled(lambda: False, lambda: None, lambda: cancelled.append(1))
    )

    def script(t):
        t.begin()
        t.until(lambda: begun)
        t.clock.sleep(0.02)
        t.ctx.stop.press("a finger is in it")
        t.wait_hub("stopped")

    trial.run(script)
    assert begun and cancelled


def test_the_time_limit_of_sinking_follows_the_speed_scale(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.state.allow(1e9)
    lifted.ctx.contact.share_gone = lambda: 0.0
    lifted.ctx.arm.speed_scale = lambda: 0.2
    began = lifted.trial.clock.now()
    monkeypatch.setattr(
        weight, "rise", lambda *_: Polled(lambda: lifted.trial.clock.now() > began + 10.0, lambda: None)
    )
    with using(lifted.trial.clock):
        assert person_holds(lifted.state, {"mass": 0.31, "load_share": 0.5}) is False
