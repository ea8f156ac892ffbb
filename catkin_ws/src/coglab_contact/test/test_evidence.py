"""Evidence of contact, grip and load: each source at its limits, and their combination."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_contact.detector import ContactDetector, DetectorSettings
from coglab_contact.evidence import (
    MOMENTUM,
    Evidence,
    Fingers,
    InPalm,
    Touch,
)
from coglab_contact.fused_detector import IN_MOTION, LIFT, RELEASE, FusedDetector
from coglab_contact.load import LeavingLoad


@dataclass
class Motor:
    """As MotorStatus."""

    position: int = 40
    current: int = 0
    force: int = 5
    moving: bool = False
    target_reached: bool = False
    over_current: bool = False


@pytest.mark.parametrize(
    ("newton", "deviation", "margin"),
    [(0.25, 0.0, 0.5), (0.6, 0.1, 1.0), (0.5, math.nan, 1.0)],
)
def test_touch_counts_from_half_a_newton_or_six_deviations(newton, deviation, margin):
    touch, forces = Touch(), [[0.0, 0.0, 0.0], [0.6 * newton, 0.0, -0.8 * newton]]
    assert touch.feed(1.0, forces, deviation).margin == 0.0, "one sample is no evidence"
    second = touch.feed(1.01, forces, deviation)
    assert second.margin == pytest.approx(margin) and second.until == pytest.approx(1.06)
    assert f"{newton:.1f} N" in second.message
    assert touch.feed(1.02, [[0.1, 0.0, 0.0]]).margin == pytest.approx(0.2), "the smaller of two consecutive samples"
    touch.reset()
    assert touch.feed(1.03, forces).margin == 0.0
    for nothing in ([], [[math.nan, 0.0, 0.0]], [[math.inf, 0.0, 0.0]]):
        assert touch.feed(1.04, nothing) is None
    assert touch.feed(math.nan, forces) is None


@pytest.mark.parametrize(
    ("distance", "degrees", "speed", "seen"),
    [
        (0.0149, 19.9, 0.0299, True),
        (0.0151, 0.0, 0.0, False),
        (0.0, 20.1, 0.0, False),
        (0.0, 0.0, 0.031, False),
    ],
)
def test_an_object_is_seen_in_the_palm(distance, degrees, speed, seen):
    palm = InPalm()
    found = [palm.feed(0.03 * k, distance, math.radians(degrees), speed) for k in range(6)]
    assert [each.margin for each in found] == [0.0] * 4 + [1.0 if seen else 0.0] * 2, "for 0.12 s"
    assert found[5].until == pytest.approx(0.15 + 0.12)
    assert palm.feed(0.05, distance, 0.0, 0.0).margin == 0.0, "a set clock restarts the confirmation"
    for bad in range(4):
        assert palm.feed(*[math.nan if k == bad else 1.0 for k in range(4)]) is None


@pytest.mark.parametrize(
    ("change", "margin", "word"),
    [
        ({"position": 36}, 0.5, "moved"),
        ({"force": 15}, 0.5, "is strained"),
        ({"current": 59}, 0.0, ""),
    ],
)
def test_evidence_of_a_standing_motor(change, margin, word):
    """Limits: 8 counts of motion, 20 of tension. A current does not count in its first status."""
    fingers = Fingers()
    first = fingers.feed(2.0, [Motor(), Motor()])
    assert first.margin == 0.0 and first.until == pytest.approx(2.4)
    shown = fingers.feed(2.1, [Motor(), Motor(**change)])
    assert shown.margin == pytest.approx(margin)
    assert shown.message == (f"motor 1 of the hand stands and {word}" if word else "")
    assert fingers.feed(2.2, []) is None


def test_a_finger_that_stops_before_its_target_is_a_contact():
    fingers = Fingers()
    fingers.feed(0.0, [Motor(moving=True)])
    stopped = fingers.feed(0.1, [Motor(position=90, over_current=True)])
    assert stopped.margin == pytest.approx(1.2)
    assert "motor 0" in stopped.message
    assert fingers.feed(0.2, [Motor(position=90, over_current=True)]).margin == 0.0, "reported once"
    for end in ({"target_reached": True, "over_current": True}, {"over_current": False}):
        fingers = Fingers()
        fingers.feed(0.0, [Motor(moving=True)])
        assert fingers.feed(0.1, [Motor(position=90, **end)]).margin == 0.0


def test_a_share_must_be_gone_for_50_ms_and_a_restarted_estimate_resets_it():
    load = LeavingLoad(1.0, 0.5, 100.0, 9.81)
    said = [load.feed(0.01 * k, 4.9, False, False) for k in range(12)]
    assert said.index(True) == 5 and sum(said) == 1
    load = LeavingLoad(1.0, 0.5, 100.0, 9.81)
    for k in range(4):
        assert not load.feed(0.01 * k, 4.9, False, False)
    assert not load.feed(0.04, None, False, False), "no data"
    assert not any(load.feed(0.05 + 0.01 * k, 4.9, False, False) for k in range(5))
    assert load.feed(0.101, 4.9, False, False)
    load.feed(0.2, None, False, True)
    assert load.share is None, "the gap has no data"
    for k in range(25):
        load.feed(0.21 + 0.005 * k, 3.0, True, False)
    assert load.share == pytest.approx((9.81 - 3.0) / 9.81), "a load carried before the gap counts as gone"


class Moving:
    """Replaces the model of the moving arm; the test sets its values."""

    def __init__(self):
        self.load, self.hangs, self.fresh, self.change = 0.0, 0.0, False, object()
        self.residual = self.told = self.before = None
        self.payloads = []

    def feed(self, stamp, position, torque, made=None):
        self.residual = SimpleNamespace(torque=np.full(7, self.hangs), position=np.zeros(7), fresh=self.fresh)

    def weight_since(self, before):
        return float(self.hangs - before[0])

    def weight(self, residual, position):
        return self.hangs

    def set_payload(self, mass, centre):
        self.load = mass
        self.payloads.append((mass, tuple(centre)))

    weight_before_motion = before_motion = lambda self: self.before
    slow = still = lambda self: True
    steady = lambda self: None  # noqa: E731
    evidence = lambda self: self.told  # noqa: E731
    force_since = lambda self, before: np.full(3, self.hangs) - before[:3]  # noqa: E731


def fused():
    moving = Moving()
    return FusedDetector(ContactDetector(DetectorSettings(), lambda q: np.zeros((3, 7))), moving), moving


def measured(detector, begin, end, step=0.01):
    """Feed from ``begin`` to ``end``. Returns (event, its time)."""
    for k in range(round((end - begin) / step)):
        event = detector.feed_measured(begin + step * k, np.zeros(7), np.zeros(7))
        if event is not None:
            return event, begin + step * k
    return None, end


@pytest.mark.parametrize("mode", [LIFT, IN_MOTION, RELEASE])
def test_an_arming_ends_at_its_time_limit(mode):
    detector, moving = fused()
    moving.before = np.zeros(7) if mode != RELEASE else 0.0
    detector.arm(mode, 0.0, 1.0, mass=0.5)
    moving.told = Evidence(MOMENTUM, 0.0, 9.0, 0.1)
    measured(detector, 0.0, 0.995)
    assert detector.state() == "watching"
    measured(detector, 1.01, 1.05)
    assert detector.state() != "watching"
    moving.told = Evidence(MOMENTUM, 0.0, 9.0, 2.0)
    assert measured(detector, 1.05, 1.2)[0] is None


@pytest.mark.parametrize("jump", [-100.0, 1.5])
def test_an_arming_keeps_its_remaining_time_if_the_clock_is_set(jump):
    detector, moving = fused()
    detector.arm(IN_MOTION, 0.0, 1.0)
    moving.told = Evidence(MOMENTUM, 0.0, 1e6, 0.5)
    measured(detector, 0.0, 0.5)
    measured(detector, 0.5 + jump, 0.95 + jump)
    assert detector.state() == "watching"
    measured(detector, 1.05 + jump, 1.1 + jump)
    assert detector.state() != "watching"
