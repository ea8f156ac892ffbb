"""Fingers that loosen with the load that a person takes: how far, how they stop, and what they hold with."""

import pytest
from coglab_smach.ports.interfaces import HandState
from coglab_smach.ports.pending import Polled
from coglab_smach.states.loosening_grip import LooseningGrip


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


def test_no_looser_than_so_many_counts_and_no_weaker_than_what_friction_needs():
    for index, least, opens in ((149, 1.0, True), (148, 1.0, False), (155, 25.9, True), (155, 26.2, False)):
        hand, felt = Hand(), [30.0]
        grip = LooseningGrip(hand, 40, 60, 140, lambda felt=felt: felt[0])
        hand.index = index
        grip.ease_to(0.5, least, 12.0, 0.0)
        assert (hand.orders == [("open", 140)]) == opens, (index, least)
