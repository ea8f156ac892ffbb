"""Fingers that loosen while a person takes the load: the measured grip force follows the load, both ways."""

from types import SimpleNamespace

import pytest
from coglab_smach.ports.interfaces import HandState
from coglab_smach.states.loosening_grip import FIRMER, WEAKER, LooseningGrip
from test_giving import WEIGHT, giving


class Hand:
    """A hand with a grip of 5 N per count; it opens with 50 counts/s and closes with 100 counts/s."""

    def __init__(self):
        self.closed, self.way, self.at, self.orders = 160.0, 0.0, 160.0, []

    def state(self):
        return HandState(True, True, False, True, positions=(200, *[int(self.at)] * 4))

    def force(self):
        return max(0.0, 5.0 * (self.at - 150.0))

    def _go(self, name, way):
        self.way = way
        self.orders.append(name)
        cancel = lambda: setattr(self, "way", 0.0)  # noqa: E731
        return SimpleNamespace(done=lambda: self.way > 0.0 and self.at >= self.closed, cancel=cancel)

    def open(self, speed):
        return self._go("open", -50.0)

    def close(self, speed):
        return self._go("close", 100.0)

    def step(self):
        self.at = min(self.closed, self.at + 0.01 * self.way)


def test_the_grip_force_follows_the_wanted_part_both_ways():
    hand = Hand()
    grip = LooseningGrip(hand, 40, 120, 150, hand.force)
    for k, part in enumerate((1.0, 0.8, 0.5, 0.3, 0.6, 0.9, 0.4)):
        for i in range(100):
            assert grip.ease_to(part, 1.0, 12.0, k + 0.01 * i)
            hand.step()
        assert 1.0 - WEAKER - 0.02 < hand.force() / (50.0 * part) < 1.0 + FIRMER + 0.02


@pytest.mark.parametrize("late", [0, 2, 4, 6])
def test_delayed_force_does_not_make_the_fingers_oscillate(late):
    """``late``: delay of the force in periods of 10 ms, as on the hand's serial line."""
    hand = Hand()
    felt = [hand.force()] * (late + 1)
    grip = LooseningGrip(hand, 40, 120, 150, lambda: felt[-1 - late])
    for k in range(300):
        grip.ease_to(0.5, 1.0, 12.0, 0.01 * k)
        hand.step()
        felt.append(hand.force())
    assert len(hand.orders) <= 4 and 1.0 - WEAKER - 0.02 < hand.force() / 25.0 < 1.0 + FIRMER + 0.02


def test_the_grip_keeps_the_friction_force_and_the_limit_of_loosening():
    for least, counts, force in ((20.0, 12.0, 20.0), (0.0, 4.0, 30.0)):
        hand = Hand()
        grip = LooseningGrip(hand, 40, 120, 150, hand.force)
        for k in range(200):
            grip.ease_to(0.0, least, counts, 0.01 * k)
            hand.step()
        assert hand.force() == pytest.approx(force, rel=0.2)


def test_a_hand_without_force_sensors_loosens_by_counts():
    hand = Hand()
    grip = LooseningGrip(hand, 40, 120)
    assert not grip.ease_to(0.5, 1.0, 12.0, 0.0) and not hand.orders


def test_the_measured_grip_falls_and_returns_with_the_load():
    def script(t):
        t.cell.touch, grips = 5.0, []
        firm = t.ctx.contact.grip()
        for share in (0.3, 0.45, 0.58):
            t.cell.push(share * WEIGHT)
            t.clock.sleep(0.8)
            grips.append(t.ctx.contact.grip() / firm)
        assert grips == pytest.approx([0.7, 0.55, 0.42], abs=0.13) and grips == sorted(grips, reverse=True)
        t.cell.push(0.3 * WEIGHT)
        t.clock.sleep(1.5)
        assert t.ctx.contact.grip() > 1.3 * grips[-1] * firm, "a part of the load has returned"
        t.cell.push(0.0)
        t.clock.sleep(1.5)
        assert t.ctx.contact.grip() == firm and not t.grip.shared
        t.wait_hub("wait_with_object")

    trial = giving(script)
    assert trial.result().outcome == "failed_holding" and trial.ctx.holding == "mug"
