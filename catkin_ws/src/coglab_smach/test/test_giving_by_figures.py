"""Giving at the edges of its figures: shares of the load, newtons, counts of the fingers, metres and seconds."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_smach.ports.interfaces import DmpProgress, HandState
from coglab_smach.ports.pending import Polled, Ready
from coglab_smach.states import give
from coglab_smach.states.give import GiveLoad, WaitTaker
from coglab_smach.states.hand import closes_gently, firm_speed, gentle
from coglab_smach.states.loosening_grip import LooseningGrip
from coglab_trials.virtual_clock import using
from conftest import Trial

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
ENTRY = {
    "mass": 0.5,
    "friction": 0.5,
    "grasps": {
        "g": {"hand": {"mode": "cylindrical", "level": "high"}},
        "low": {"hand": {"mode": "cylindrical", "level": "low"}},
    },
}

# --- the grip ---------------------------------------------------------------------------------------------------------


class Hand:
    """Fingers that the test puts somewhere; ``orders``: what they were told."""

    def __init__(self, index=160):
        self.index, self.orders, self.done = index, [], False

    def state(self):
        return HandState(True, True, False, True, positions=(0, 150, self.index, 150, 150))

    def _order(self, name, speed):
        self.orders.append((name, speed))
        return Polled(lambda: self.done, lambda: None, lambda: self.orders.append("stand"))

    def open(self, speed):
        return self._order("open", speed)

    def close(self, speed):
        return self._order("close", speed)


def test_fingers_loosen_by_whole_counts_and_stand_there():
    hand = Hand()
    grip = LooseningGrip(hand, 40, 60)
    assert grip.loosened() == 0
    for counts, orders in ((0.9, []), (1.0, [("open", 40)]), (1.0, [("open", 40)])):
        grip.loosen_to(counts)
        assert hand.orders == orders
    hand.index = 159
    grip.loosen_to(1.0)
    assert hand.orders == [("open", 40), "stand"] and grip.loosened() == 1
    grip.loosen_to(1.9)
    assert len(hand.orders) == 2
    grip.loosen_to(2.0)
    assert hand.orders[2:] == [("open", 40)]
    hand.done = True
    grip.loosen_to(5.0)
    assert hand.orders[3:] == ["stand"], "they do not go on"
    hand.done = False
    grip.tighten()
    grip.tighten()
    assert hand.orders[4:] == [("close", 60)]
    grip.loosen_to(9.0)
    assert hand.orders[5:] == [], "they close first"
    hand.done, hand.index = True, 150
    grip.loosen_to(0.0)
    assert grip.loosened() == 0, "what they hold with then is the closed grip"


@pytest.mark.parametrize(("force", "order"), [(11.6, [("open", 140)]), (11.4, []), (7.1, []), (6.9, [("close", 60)])])
def test_a_grip_is_left_alone_within_15_percent_more_and_30_less_than_wanted(force, order):
    hand, felt = Hand(), [20.0]
    grip = LooseningGrip(hand, 40, 60, 140, lambda: felt[0])
    hand.index, felt[0] = 155, force
    assert grip.ease_to(0.5, 1.0, 12.0, 0.0) and hand.orders == order


def test_a_grip_that_falls_is_stopped_four_hundredths_of_a_second_ahead_and_looked_at_a_tenth_later():
    hand, felt = Hand(), [20.0]
    grip = LooseningGrip(hand, 40, 60, 140, lambda: felt[0])
    grip.ease_to(0.5, 1.0, 12.0, 0.0)
    assert hand.orders == [("open", 140)]
    # 100 N/s down, of which the estimate believes a half with each look.
    rate, now, force = 0.0, 0.0, 20.0
    while len(hand.orders) == 1 and force > 0.0:
        now, force = now + 0.01, force - 1.0
        rate += 0.5 * (-100.0 - rate)
        felt[0] = force
        grip.ease_to(0.5, 1.0, 12.0, now)
        assert (force + 0.04 * rate <= 10.0) == (hand.orders[1:] == ["stand"]), force
    assert force == pytest.approx(13.0)
    felt[0] = 30.0
    for after, orders in ((0.09, 2), (0.11, 3)):
        grip.ease_to(0.5, 1.0, 12.0, now + after)
        assert len(hand.orders) == orders


def test_a_second_look_in_the_same_moment_tells_nothing_about_the_rate():
    hand, felt = Hand(), [20.0]
    grip = LooseningGrip(hand, 40, 60, 140, lambda: felt[0])
    grip.ease_to(0.5, 1.0, 12.0, 3.0)
    felt[0] = 11.0
    assert grip.ease_to(0.5, 1.0, 12.0, 3.0) and hand.orders == [("open", 140)]


def test_no_looser_than_so_many_counts_and_no_weaker_than_what_friction_needs():
    for index, least, opens in ((149, 1.0, True), (148, 1.0, False), (155, 25.9, True), (155, 26.2, False)):
        hand, felt = Hand(), [30.0]
        grip = LooseningGrip(hand, 40, 60, 140, lambda felt=felt: felt[0])
        hand.index = index
        grip.ease_to(0.5, least, 12.0, 0.0)
        assert (hand.orders == [("open", 140)]) == opens, (index, least)


def test_the_lowest_level_is_gentle_and_firm_is_what_the_file_says():
    ctx = Trial().ctx
    assert firm_speed(ctx, ENTRY, "g") == 200 and firm_speed(ctx, ENTRY, "low") == 0
    assert gentle(ENTRY["grasps"]["g"])["level"] == "low" and closes_gently(ENTRY["grasps"]["g"])


# --- the load ---------------------------------------------------------------------------------------------------------


class Given:
    """A GiveLoad whose parts the test calls; ``did``: what it did with the grip and the arm."""

    def __init__(self, monkeypatch, sunk=0.0):
        self.trial, self.did, self.hand, self.way = Trial(), [], 0.1, None
        state = self.state = GiveLoad(self.trial.ctx)
        state._deadline = 1e9
        note = lambda name: lambda *a: self.did.append((name, *a))  # noqa: E731
        state._fingers = SimpleNamespace(loosened=lambda: 1, tighten=note("tighten"), stand=note("stand"))
        state._fingers.loosen_to, state._fingers.ease_to = note("loosen"), self.ease
        state._held = SimpleNamespace(sunk=sunk, there=lambda: True)
        state._needed, state._weight, state._firm = 0.6, 5.0, 140
        state._slips_at = 4.0
        state._offer = lambda: None if self.way is None else np.array([self.way, 0.0, 0.0])
        self.eases = False
        monkeypatch.setattr(give, "hand_from_palm", lambda s: self.hand)
        monkeypatch.setattr(give, "shift", lambda ctx, way, speed: self.did.append(("bring", speed)) or Ready())
        monkeypatch.setattr(give, "rise", lambda ctx, by, speed: self.did.append(("rise", by, speed)) or Ready())

    def ease(self, part, least, counts, now):
        self.eased = (part, least, counts)
        return self.eases


@pytest.mark.parametrize(
    ("share", "did", "shared"),
    [
        (0.3, [("loosen", pytest.approx(1.0))], True),
        (0.6, [("loosen", pytest.approx(4.0))], True),
        (0.9, [("loosen", pytest.approx(4.0))], True),
        (0.2, [("stand",)], False),
        (0.11, [("stand",)], False),
        (0.1, [("stand",)], False),
    ],
)
def test_the_grip_loosens_from_a_fifth_of_the_weight_to_the_needed_share(monkeypatch, share, did, shared):
    given = Given(monkeypatch)
    given.state._follow(share, 0.2, 0.0)
    assert given.did == did and given.state._grip.shared == shared


def test_a_load_that_came_back_for_a_tenth_of_a_second_is_held_again(monkeypatch):
    given = Given(monkeypatch)
    given.state._grip.shared = True
    for now, closed in ((0.0, False), (0.09, False), (0.11, True)):
        given.state._follow(0.05, 0.2, now)
        assert (("tighten",) in given.did) == closed
    assert not given.state._grip.shared and given.state._grip.firm == 140
    given.did.clear()
    given.state._follow(0.15, 0.2, 0.2)
    given.state._follow(0.05, 0.2, 0.25)
    assert ("tighten",) not in given.did, "counted anew"


@pytest.mark.parametrize(("loosened", "closes"), [(0, False), (1, True), (None, False)])
def test_a_grip_that_was_never_loosened_is_not_closed_again(monkeypatch, loosened, closes):
    given = Given(monkeypatch)
    given.state._fingers.loosened = lambda: loosened
    given.state._keep()
    assert given.did == [("stand",), *[("tighten",)] * closes] and given.state._grip.firm == 140 * closes


@pytest.mark.parametrize(("sunk", "closes"), [(0.029, False), (0.031, True)])
def test_an_object_that_sinks_by_3_cm_is_held_again(monkeypatch, sunk, closes):
    given = Given(monkeypatch, sunk)
    given.state._follow(0.5, 0.2, 0.0)
    assert (given.did == [("tighten",)]) == closes


@pytest.mark.parametrize(
    ("share", "part", "least"), [(0.25, 0.75, 6.0), (1.0, 0.0, 0.0), (1.4, 0.0, 0.0), (-0.5, 1.5, 12.0)]
)
def test_where_touch_tells_the_grip_it_is_twice_what_friction_needs_for_the_rest(monkeypatch, share, part, least):
    given = Given(monkeypatch)
    assert given.state._ease(share) is False
    assert given.eased == (pytest.approx(part), pytest.approx(least), 12.0)


@pytest.mark.parametrize(
    ("weight", "pressed", "counts"), [(5.0, 5.1, True), (5.0, 4.9, False), (0.5, 2.1, True), (0.5, 1.9, False)]
)
def test_a_hand_presses_with_the_weight_or_2_newton_for_three_tenths_of_a_second(monkeypatch, weight, pressed, counts):
    given = Given(monkeypatch)
    given.state._weight = weight
    told = [given.state._is_pressed(-pressed / weight, now) for now in (0.0, 0.29, 0.31)]
    assert told == [False, False, counts]
    assert not given.state._is_pressed(0.0, 0.4) and not given.state._is_pressed(-pressed / weight, 0.5)


def test_the_arm_sinks_when_the_motion_before_has_ended(monkeypatch):
    given, over = Given(monkeypatch), []
    ended = []
    given.state.ctx.arm.cancel_motion = lambda why: ended.append(why) or Polled(lambda: bool(over), lambda: None)
    given.state._moving = Polled(lambda: False, lambda: None)
    for now in range(3):
        given.state._sink_with_them(float(now))
    assert len(ended) == 1 and given.state._sinks == 0
    over.append(1)
    given.state._sink_with_them(3.0)
    assert given.state._sinks == 1 and given.state._moving is None


def test_the_arm_sinks_three_times_with_a_hand_that_presses(monkeypatch):
    given = Given(monkeypatch)
    for now in range(6):
        given.state._sink_with_them(float(now))
    assert given.did == [("rise", -0.03, 0.03)] * 3


@pytest.mark.parametrize(
    ("hand", "way", "now", "did"),
    [
        (0.1, 0.07, 1.0, ["bring"]),
        (0.1, 0.05, 1.0, []),
        (0.1, 0.03, 3.0, ["bring"]),
        (0.1, 0.01, 3.0, ["rise"]),
        (0.1, 0.01, 2.9, []),
        (0.1, 0.24, 1.0, ["bring"]),
        (0.1, 0.26, 1.0, []),
        (0.24, 0.1, 1.0, ["bring"]),
        (0.25, 0.1, 9.0, []),
        (None, 0.1, 9.0, []),
        (0.1, None, 3.0, ["rise"]),
    ],
)
def test_the_object_is_brought_to_a_hand_that_waits_elsewhere_or_the_arm_sinks(monkeypatch, hand, way, now, did):
    """Farther than 6 cm at once, than 2 cm once it would sink; both times within give.near, and seen there twice."""
    given = Given(monkeypatch)
    given.hand, given.way, given.state._lower_at = hand, way, 3.0
    for look in (now - 0.01, now):
        given.state._bring_or_lower(look)
    assert [each[0] for each in given.did] == (did if now < 9.0 else [])
    assert given.state._look_at == pytest.approx(now + 0.3)
    if did == ["bring"]:
        assert given.did[0] == ("bring", 0.08) and given.state._lower_at == pytest.approx(now + way / 0.08 + 3.0)


def test_a_hand_that_moves_is_not_brought_anything_and_three_times_at_most(monkeypatch):
    given = Given(monkeypatch)
    for k, way in enumerate((0.1, 0.121, 0.1, 0.121)):
        given.way = way
        given.state._bring_or_lower(0.1 * k)
    assert given.did == [], "2 cm between two looks"
    for k in range(12):
        given.way = 0.1
        given.state._lower_at = math.inf
        given.state._bring_or_lower(1.0 + 0.1 * k)
    assert [each[0] for each in given.did] == ["bring"] * 3


def test_what_a_delivery_asks_for_is_what_is_waited_for():
    """Seven tenths of the weight, for five seconds."""
    trial = Trial()
    entry = trial.database.get("mug")
    delivery = {**entry["deliveries"]["handle_first"], "release": {"threshold": 0.7, "timeout": 5.0}}
    trial.database.get = lambda object_id: {**entry, "deliveries": {"handle_first": delivery}}
    trial.cell.partner.take_after = None
    armed, arm = [], trial.ctx.contact.arm
    trial.ctx.contact.arm = lambda mode, limit, settings: (
        armed.append((mode, limit, settings)) or arm(mode, limit, settings)
    )

    def script(t):
        t.wait_hub("wait_without_object")
        t.start(RECEIVE)
        t.wait_hub("wait_with_object")
        t.start(GIVE)
        t.wait_hub("wait_with_object")

    trial.run(script)
    # Then it is felt whether the person holds it all the same.
    assert armed[-2:] == [("release", limit, {"mass": 0.31, "load_share": 0.7}) for limit in (10.0, 16.0)]
    assert "the person's taking of the load within 5.0 s" in trial.ctx.journal.why()
    assert ("lift", 5.0, {"mass": 0.31, "load_share": 0.5}) in armed


# --- the end of a reach toward a person -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("to_go", "hand", "ends"),
    [(0.079, 0.24, True), (0.081, 0.1, False), (0.0, 0.1, False), (0.05, 0.25, False), (0.05, None, False)],
)
def test_a_reach_comes_to_its_end_within_8_cm_with_the_hand_within_25(monkeypatch, to_go, hand, ends):
    state = WaitTaker(Trial().ctx)
    state.ctx.arm.dmp_progress = lambda: DmpProgress("running", "", "p", 0.1, to_go)
    monkeypatch.setattr(give, "hand_from_palm", lambda s: hand)
    assert state._comes_to_its_end() == ends


@pytest.mark.parametrize(
    ("hand", "to_go", "leaves"),
    [
        (0.092, 0.05, True),
        (0.094, 0.05, False),
        (0.099, 0.056, False),
        (0.099, 0.058, True),
        (0.101, 0.2, False),
        (None, 0.2, False),
    ],
)
def test_a_goal_leaves_that_is_7_mm_nearer_than_the_delivery_or_goes_away_again(monkeypatch, hand, to_go, leaves):
    """0.10 m from the palm to the hand is where the object is offered; 0.05 m to go was the nearest."""
    trial = Trial()
    state, went = WaitTaker(trial.ctx), [0.05, 0.05, to_go]
    state._deadline = 1e9
    state.ctx.arm.dmp_progress = lambda: DmpProgress("running", "", "p", 0.1, went.pop(0) if len(went) > 1 else went[0])
    state.ctx.contact.arm = lambda *a: Ready()
    state.ctx.contact.event = lambda: None
    state.arrived = lambda: trial.clock.now() > 1.0
    state.await_reach = lambda near: state.wait_for(near, "the end", 9.0)
    monkeypatch.setattr(give, "hand_from_palm", lambda s: hand)
    with using(trial.clock):
        why = state._await_taker({}, {"offset": (0.0, 0.06, 0.08)})
    assert bool(why) == leaves and (trial.clock.now() < 0.5) == leaves
    assert not leaves or "and is followed no more" in why
