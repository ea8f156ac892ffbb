"""The detector of an arm at rest: learning, thresholds, times, and detection in synthetic torques."""

import dataclasses
import math

import numpy as np
import pytest
from arms import DT, ContactTrial, found_within, jacobian, push
from coglab_contact.detector import TUNABLE, ContactDetector, DetectorSettings
from coglab_msgs.msg import ReasonCode

STEP = 1.0 / 128.0

JACOBIAN = np.array(
    [
        [0.0, 0.9, 0.0, 0.9, 0.0, 0.0, 0.0],
        [0.4, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0],
        [0.0, 0.5, 0.0, -0.3, 0.0, 0.0, 0.0],
    ]
)
"""m/rad: joints 1, 2 and 4 measure forces across the x axis"""

WATCHED = [1, 2, 4]


class Rest:
    """A detector fed with samples of the test, starting at rest."""

    def __init__(self, jacobian=JACOBIAN, **settings):
        self.detector, self.n = ContactDetector(DetectorSettings(**settings), lambda q: jacobian), 0

    @property
    def t(self):
        return self.n * STEP

    def feed(self, torque=0.0, samples=1, speed=0.0):
        """Feed samples of one torque (Nm, all joints or each). Returns (event, needed samples) or (None, samples)."""
        for k in range(samples):
            self.n += 1
            event = self.detector.feed(self.t, np.zeros(7) + torque, np.zeros(7), np.full(7, speed))
            if event is not None:
                return event, k + 1
        return None, samples

    def armed(self, mode="contact", timeout=100.0, **request):
        """Arm and wait until the detector watches."""
        self.feed(samples=150)
        self.detector.arm(mode, self.t, timeout, **request)
        assert self.feed() == (None, 1) and self.detector.state() == "watching"
        return self


def joint(number, torque):
    """Torque (Nm) on one joint, number 1..7."""
    return torque * (np.arange(1, 8) == number)


def test_a_request_may_name_joints_and_sensitivity():
    assert Rest().armed(joints=[3]).feed(joint(2, 5.0), 30)[0] is None
    assert Rest().armed(joints=[3]).feed(joint(3, 0.2), 30)[0] is not None
    assert Rest().armed(joints=[7]).feed(joint(7, 0.2), 30)[0] is not None
    assert Rest().armed(k=12.0).feed(joint(2, 0.2), 30)[0] is None
    rest = Rest().armed(k=12.0)
    assert rest.detector.look().threshold == pytest.approx([0.24] * 7) and rest.detector.look().k == 12.0
    for joints in ([0], [8], [1, 8]):
        with pytest.raises(ValueError, match="numbered 1..7"):
            rest.detector.arm("contact", 0.0, 1.0, joints=joints)
    for timeout in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="positive time"):
            rest.detector.arm("contact", 0.0, timeout)


def test_a_carried_object_is_no_early_contact():
    rest = Rest()
    rest.feed(samples=150)
    rest.feed(samples=20, speed=0.3)
    rest.detector.arm("contact", rest.t, 100.0, carries=True)
    assert rest.feed(joint(4, 5.0), 60)[0] is None and rest.detector.state() == "watching"


@pytest.mark.parametrize("aside", [-0.5, 0.0, 1.2, 40.0])
def test_a_single_outlier_is_ignored(aside):
    """It is neither a torque nor a set clock."""
    rest = Rest().armed()
    assert rest.detector.feed(rest.t + aside, np.full(7, 50.0), np.zeros(7), np.zeros(7)) is None
    assert rest.detector.state() == "watching"
    assert rest.feed(0.0, 20)[0] is None and rest.feed(joint(2, 0.2), 5)[0] is not None


@pytest.fixture(scope="module")
def posture():
    q = np.array([-0.6061, -0.9433, 1.0005, 1.3126, 0.2177, 0.4836, 0.6219])  # the palm in front of a person
    return q, jacobian(q)


def test_lateral_three_newtons_are_detected_within_sixty_milliseconds(posture):
    share, median = found_within(posture, (0, 1, 0), 3.0)
    assert share >= 0.95, f"{share:.0%} within 60 ms, median {median * 1000:.0f} ms"


def test_no_false_alarm_in_two_hundred_still_runs(posture):
    for seed in range(200):
        run = ContactTrial(posture, 1000 + seed)
        assert run.rest_and_arm() is None
        event, when = run.feed(1.0)
        assert event is None, f"seed {seed}: {event} after {when:.2f} s"


def test_never_watches_while_the_arm_moves(posture):
    for seed in range(20):
        run = ContactTrial(posture, seed)
        run.feed(1.0)
        run.detector.arm("contact", run.t, 30.0)
        for k in range(400):
            v = np.full(7, 0.5 * np.sin(np.pi * k / 400) + 0.03)
            event, _ = run.feed(DT, push((0, 1, 0), 8.0), lambda t, v=v: v)
            assert event is None and run.detector.state() != "watching"


def test_arming_ends_at_its_time_limit(posture):
    run = ContactTrial(posture, 4)
    run.feed(1.0)
    run.detector.arm("contact", run.t, 0.5)
    assert run.feed(0.6)[0] is None
    assert run.detector.state() == "off"
    assert run.feed(0.3, push((0, 1, 0), 10.0))[0] is None


def test_an_early_touch_is_detected_by_its_offset(posture):
    run = ContactTrial(posture, 5)
    run.feed(1.5)
    moving = np.full(7, 0.3)
    pressing = push((0, 1, 0), 5.0, rise=1e-6)
    run.feed(1.0, velocity=lambda t: moving)
    run.feed(0.3, pressing, lambda t: moving)
    run.detector.arm("contact", run.t, 10.0)
    event, _ = run.feed(1.0, pressing)
    assert event is not None and event.source == "torque_offset" and event.contact
    assert event.code == ReasonCode.CONTACT_CAME_EARLY and event.confidence > 0.5


def test_a_released_push_at_rest_leaves_no_offset(posture):
    """The jolts of push and release are no motions, so the rest with the force is no reference."""
    run = ContactTrial(posture, 5)
    run.feed(1.5)
    jolt = lambda t: np.full(7, 0.05)  # noqa: E731
    for _ in range(2):
        run.feed(0.05, push((0, 1, 0), 8.0, rise=1e-6), jolt)
        run.feed(1.5, push((0, 1, 0), 8.0, rise=1e-6))
        run.feed(0.05, velocity=jolt)
        run.feed(0.1)
    run.detector.arm("contact", run.t, 10.0)
    assert run.feed(1.0)[0] is None
    run.feed(0.4, velocity=lambda t: np.full(7, 0.3))
    assert run.feed(1.0)[0] is None, "also after a motion from there"


def test_a_touch_that_jolts_the_arm_is_detected_as_a_touch(posture):
    """There was no contact on arming, after a motion."""
    run = ContactTrial(posture, 7)
    run.feed(1.5)
    run.feed(1.0, velocity=lambda t: np.full(7, 0.3))
    run.feed(1.0)
    run.detector.arm("contact", run.t, 10.0)
    assert run.feed(0.5)[0] is None
    pressing = push((0, 1, 0), 8.0, rise=1e-6)
    assert run.feed(0.02, pressing, lambda t: np.full(7, 0.05))[0] is None
    event, _ = run.feed(1.0, pressing)
    assert event is not None and event.code == ReasonCode.CONTACT_FOUND, event


def test_only_one_event_per_arming(posture):
    run = ContactTrial(posture, 6)
    run.rest_and_arm()
    assert run.feed(0.3, push((0, 1, 0), 5.0))[0] is not None
    assert run.feed(0.3, push((0, -1, 0), 9.0))[0] is None


@pytest.mark.parametrize("mass", [0.2, 0.31, 0.8])
def test_release_is_detected_when_the_load_leaves(posture, mass):
    weight = mass * 9.81
    held = lambda t: (0, 0, -weight)  # noqa: E731
    for seed in range(20):
        run = ContactTrial(posture, seed)
        run.feed(1.5, held)
        run.detector.arm("release", run.t, 10.0, mass=mass, load_share=0.6)
        assert run.feed(1.0, held)[0] is None, "no release while the robot carries all of it"
        event, delay = run.feed(1.5, lambda t: (0, 0, -weight * max(0.0, 1 - t / 0.5)))
        assert event is not None and not event.contact
        assert 0.2 <= delay <= 0.6


def test_load_is_counted_from_before_the_contact(posture):
    weight = 0.31 * 9.81
    for seed in range(20):
        trial = ContactTrial(posture, seed)
        trial.rest_and_arm()
        event, _ = trial.feed(0.3, push((0, -1, 0), 3.0))
        assert event is not None
        trial.detector.arm("load", trial.t, 5.0, mass=0.31)
        pressing = lambda t: (0, -3.0, 0)  # noqa: E731
        assert trial.feed(1.0, pressing)[0] is None, "a pressing person takes no load"
        event, delay = trial.feed(1.0, lambda t: (0, 0, -weight * min(1.0, t / 0.3)))
        assert event is not None and event.contact and delay < 0.5


@pytest.mark.parametrize("which", ["torque", "position", "velocity"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308, -1e308, "six", "eight"])
@pytest.mark.parametrize("armed", [False, True])
def test_an_impossible_sample_is_ignored_and_a_later_push_is_detected(posture, which, value, armed):
    trial = ContactTrial(posture, 3)
    sample = {"torque": np.zeros(7), "position": trial.q, "velocity": np.zeros(7)}
    sample[which] = (
        {"six": np.zeros(6), "eight": np.zeros(8)}.get(value) if isinstance(value, str) else np.full(7, value)
    )
    trial.detector = ContactDetector(
        DetectorSettings(), lambda q: trial.jacobian * (1.0 if np.all(np.abs(q) < 10.0) else np.nan)
    )
    trial.feed(1.5)
    for arm in (False, True):
        if arm:
            trial.detector.arm("contact", trial.t, 30.0)
        if arm == armed:
            for _ in range(3):
                trial.t += 0.005
                assert trial.detector.feed(trial.t, **sample) is None
    assert trial.feed(0.3)[0] is None
    event, delay = trial.feed(0.3, push((0.0, 0.0, -1.0), 8.0))
    assert event is not None and event.contact and delay < 0.1


@pytest.mark.parametrize("step", [-3600.0, -0.4, 30.0])
def test_detection_continues_after_the_clock_was_set(posture, step):
    """The clock steps after arming: the arming keeps its remaining time, and a touch is still detected in time."""
    run = ContactTrial(posture, 21)
    assert run.rest_and_arm() is None
    run.t += step
    assert run.feed(0.6)[0] is None
    assert run.detector.state() == "watching"
    event, delay = run.feed(0.3, push((0, 1, 0), 5.0))
    assert event is not None and delay < 0.06


def test_the_noise_is_learnt_again_only_at_rest(posture):
    run = ContactTrial(posture, 4)
    with pytest.raises(ValueError, match="at rest"):
        run.detector.learn()
    run.feed(1.0)
    assert "100 samples" in run.detector.learn() and run.detector.look().rest_samples == 0
    run.detector.arm("contact", run.t, 30.0)
    with pytest.raises(ValueError, match="contact"):
        run.detector.learn()
    run.feed(0.2)
    assert run.detector.state() == "waiting"  # until there are enough samples
    run.feed(1.0)
    assert run.detector.state() == "watching" and all(
        mine == (j in run.detector.watched) for j, mine in enumerate(run.detector.look().watched)
    )
    moving = ContactTrial(posture, 5)
    moving.feed(1.0)
    moving.feed(0.1, velocity=lambda t: np.full(7, 0.1))
    with pytest.raises(ValueError, match="moves"):
        moving.detector.learn()


def test_changed_settings_during_a_motion_are_no_contact():
    for name, (low, high, _) in TUNABLE.items():
        trial = Rest()
        trial.feed(samples=150)
        for k in range(400):
            if k % 40 == 0:
                value = low if k % 80 == 0 else high
                trial.detector.use(dataclasses.replace(trial.detector.settings, **{name: value}))
            if k == 100:
                trial.detector.arm("contact", trial.t, 100.0)
            event, _ = trial.feed(2.0 * math.sin(0.05 * k), speed=0.5)
            assert event is None, name
        trial.detector.use(DetectorSettings())
        assert trial.feed(samples=300)[0] is None, name
        event, samples = trial.feed(joint(2, 1.0), samples=20)
        assert event is not None and event.contact, f"{name}: a push is detected afterwards"
