"""Grip and load by touch, and their combination with the torques of the arm."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_contact.detector import ContactDetector, DetectorSettings
from coglab_contact.evidence import FUSED, MOMENTUM
from coglab_contact.fused_detector import IN_MOTION, LIFT, RELEASE, FusedDetector
from coglab_contact.load import COVERED, OLDEST, Felt, GripAndLoad, together
from coglab_msgs.msg import ReasonCode

MASS = 0.31
WEIGHT = MASS * 9.81

TURNED = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""palm to base: the palm's y is up"""


def pinch(force, load):
    """Forces of thumb and finger along z of the palm, each with half of the load; the palm touches nothing."""
    return [[0.0, -load / 2, force], [0.0, -load / 2, -force], [0.0, 0.0, 0.0]]


def fed(*forces, deviation=0.0, seconds=1.0):
    held, t = GripAndLoad(lambda q: TURNED), 0.0
    for each in forces:
        for _ in range(round(200 * seconds)):
            t += 0.005
            held.feed(t, each, deviation, np.zeros(7))
    return held, t


def test_internal_forces_are_grip_and_vertical_ones_are_load():
    held, t = fed(pinch(12.0, 3.0))
    assert held.load(t) == pytest.approx(3.0) and held.grip(t) == pytest.approx(12.0)
    lying, t = fed([[0.0, -3.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert lying.load(t) == pytest.approx(3.0) and lying.grip(t) == pytest.approx(0.0), "nothing squeezes it"


def test_noise_is_no_grip():
    rng, held = np.random.default_rng(7000), GripAndLoad(lambda q: TURNED)
    for k in range(400):
        held.feed(0.005 * k, rng.normal(0.0, 0.05, (16, 3)), 0.05, np.zeros(7))
    assert held.grip(1.995) == 0.0 and abs(held.load(1.995)) < 0.25


def test_old_or_invalid_touch_data_is_ignored():
    assert GripAndLoad(lambda q: TURNED).grip(0.0) is None
    held, t = fed(pinch(12.0, 3.0))
    held.feed(t + 0.01, [[np.nan, 0, 0]] * 3, 0.0, np.zeros(7))
    assert held.grip(t + 0.9 * OLDEST) is not None
    assert held.grip(t + OLDEST + 0.02) is None and held.load(t + OLDEST + 0.02) is None


def test_the_share_is_counted_from_the_load_before():
    held, t = fed(pinch(12.0, 0.9 * WEIGHT))
    assert held.share_gone(t, WEIGHT) is None, "no reference load is set"
    held.count_from_now()
    for _ in range(100):
        t += 0.005
        held.feed(t, pinch(12.0, 0.4 * WEIGHT), 0.0, np.zeros(7))
    held.count_on()
    assert held.share_gone(t, WEIGHT).share == pytest.approx(0.5, abs=0.01)
    held.anew()
    assert held.share_gone(t, WEIGHT) is None


def test_sensors_that_miss_the_weight_give_no_share():
    held, t = fed(pinch(12.0, (1.0 - 1.2 * COVERED) * WEIGHT))
    held.count_from_now()
    assert held.share_gone(t, WEIGHT) is None and held.grip(t) == pytest.approx(12.0)


def test_lower_load_share_counts():
    assert together(None, 0.2, None) is None
    assert together(0.4, 0.2, None) == 0.4 and together(None, 0.2, Felt(0.3, 0.05)) == 0.3
    assert together(0.4, 0.2, Felt(0.3, 0.05)) == pytest.approx((0.4 / 0.04 + 0.3 / 0.0025) / (1 / 0.04 + 1 / 0.0025))
    assert together(0.0, 0.2, Felt(0.9, 0.05)) == 0.0 and together(0.9, 0.2, Felt(0.1, 0.05)) == 0.1


class Moving:
    """A model of an arm. The test sets the load on the palm, and whether the arm is fast."""

    def before_motion(self):
        return None

    def __init__(self):
        self.load, self.hangs, self.fast, self.change = 0.0, WEIGHT, False, None
        self.residual = None

    def feed(self, stamp, position, torque, made=None):
        self.residual = SimpleNamespace(stamp=stamp, torque=np.zeros(7), position=np.zeros(7), fresh=False)

    def weight(self, residual, position):
        return self.hangs

    def weight_before_motion(self):
        return WEIGHT

    def slow(self):
        return not self.fast

    def still(self):
        return not self.fast

    def evidence(self):
        return None

    def set_payload(self, mass, centre):
        self.load = mass


class Detector:
    """The detector with a hand that holds the mug, armed for release."""

    def __init__(self, touch=True):
        self.moving, self.t, self.grip = Moving(), 0.0, 20.0
        held = GripAndLoad(lambda q: TURNED)
        jacobian = lambda q: np.zeros((3, 7))  # noqa: E731
        self.detector = FusedDetector(ContactDetector(DetectorSettings(), jacobian), self.moving, held=held)
        self.touch, self.felt = touch, WEIGHT
        self.detector.arm(LIFT, 0.0, 5.0, mass=MASS, load_share=0.5)
        self.detector.disarm()
        self.detector.set_payload(MASS)
        self.run(1.0)
        self.detector.arm(RELEASE, self.t, 20.0, mass=MASS, load_share=0.6)

    def run(self, seconds):
        events = []
        for _ in range(round(200 * seconds)):
            self.t += 0.005
            events.append(self.detector.feed_measured(self.t, np.zeros(7), np.zeros(7)))
            if self.touch:
                events.append(self.detector.feed_touch(self.t, pinch(self.grip, self.felt)))
        return [event for event in events if event is not None]


def test_touch_measures_the_load_of_a_fast_arm():
    for touch, events in ((True, 1), (False, 0)):
        run = Detector(touch)
        run.run(0.5)
        run.moving.fast, run.felt = True, 0.2 * WEIGHT
        found = run.run(0.5)
        assert len(found) == events
        if touch:
            assert found[0].source == FUSED and found[0].code == ReasonCode.LOAD_RELEASED
            assert run.detector.share_gone() == pytest.approx(0.8, abs=0.02)
    assert run.detector.grip(run.t) is None


def test_without_touch_only_the_torques_count():
    run = Detector(False)
    run.run(0.5)
    run.moving.hangs = 0.3 * WEIGHT
    events = run.run(0.5)
    assert [event.source for event in events] == [MOMENTUM]
    assert run.detector.share_gone() == pytest.approx(0.7)


def test_a_contact_that_slips_off_the_sensors_releases_nothing():
    run = Detector()
    run.felt = 0.1 * WEIGHT
    assert run.run(0.5) == [] and run.detector.share_gone() == pytest.approx(0.0)
    assert run.detector.grip(run.t) == pytest.approx(20.0, abs=0.1)


def test_an_early_touch_does_not_change_the_reference_load():
    run = Detector()
    run.detector.arm(IN_MOTION, run.t, 5.0)
    run.felt = run.moving.hangs = 0.5 * WEIGHT
    run.run(1.0)
    run.detector.arm(RELEASE, run.t, 20.0, mass=MASS, load_share=0.6)
    run.moving.fast = True
    run.run(0.1)
    assert run.detector.share_gone() == pytest.approx(0.5, abs=0.02)
