"""Contact of a moving arm: momentum observer, learnt thresholds, and detection in analytic motions."""

from dataclasses import replace
from types import SimpleNamespace

import coglab_controllers as cc
import numpy as np
import pytest
from arms import DT, SHIPPED, URDF, Arm, ArmAsMeasured, feed, fused, jacobian, ramp
from coglab_contact.detector import ContactDetector, DetectorSettings
from coglab_contact.evidence import (
    MOMENTUM,
)
from coglab_contact.fused_detector import IN_MOTION, LIFT, FusedDetector
from coglab_contact.momentum_observer import MomentumObserver
from coglab_contact.motion_thresholds import (
    FEATURES,
    ThresholdError,
    Thresholds,
    learn,
)
from coglab_contact.moving_contact import MotionRecorder, MovingContact
from coglab_msgs.msg import ReasonCode


def test_a_known_torque_is_recovered_with_a_first_order_lag():
    arm, gain = Arm(begin=0.0), 40.0
    observer, step, at = MomentumObserver(cc.ArmDynamics(URDF), gain), np.linspace(-2.0, 2.0, 7), 0.3
    for k in range(200):
        q, _, tau = arm.at(k * DT, torque=step if k * DT >= at else np.zeros(7))
        residual = observer.feed(k * DT, q, tau)
        if residual is None:
            continue
        # The torque of a sample counts from half a period before it to half a period after the next one.
        expected = step * max(0.0, 1.0 - np.exp(-gain * (k * DT - at)))
        late = step * max(0.0, 1.0 - np.exp(-gain * (k * DT + DT - at)))
        low, high = np.minimum(expected, late) - 0.02, np.maximum(expected, late) + 0.02
        assert np.all(residual.torque >= low) and np.all(residual.torque <= high), k * DT
    assert np.allclose(residual.torque, step, atol=0.02)


def test_invalid_samples_and_short_gaps_do_not_change_the_estimate():
    arm = Arm(begin=0.0)
    whole, holed = (MomentumObserver(cc.ArmDynamics(URDF)) for _ in range(2))
    for k in range(120):
        q, _, tau = arm.at(k * DT, torque=np.full(7, 1.0))
        one = whole.feed(k * DT, q, tau)
        if k % 10 == 5:
            assert holed.feed(k * DT, np.full(7, np.nan), tau) is None
            assert holed.feed(np.nan, q, tau) is None
        elif k % 40 not in (21, 22, 23):
            other = holed.feed(k * DT, q, tau)
    assert np.allclose(one.torque, other.torque, atol=0.05)
    assert np.allclose(other.torque, 1.0, atol=0.05)


def test_samples_half_a_period_late_are_no_push():
    """A computer under load stamps some samples half a period late. Uncorrected, this gives 27 Nm."""
    arm, rng = Arm(begin=0.0), np.random.default_rng(5)
    observer, worst = MomentumObserver(cc.ArmDynamics(URDF), period=DT), 0.0
    for k in range(400):
        q, _, tau = arm.at(k * DT)
        late = rng.uniform(0.4, 0.9) * DT if k % 23 == 7 else 0.0
        residual = observer.feed(k * DT + late, q, tau)
        worst = max(worst, 0.0 if residual is None else float(np.max(np.abs(residual.torque))))
    assert worst < 2.5, worst


@pytest.mark.parametrize(("direction", "newton"), [((0, 1, 0), 4.0), ((0, -0.7, 0.7), 6.0), ((0, 0, -1), 6.0)])
def test_a_push_on_the_moving_arm_is_detected_within_eighty_milliseconds(direction, newton):
    arm, detector = Arm(sigma=0.1), fused()
    assert feed(detector, arm, 0.0, 0.7)[0] is None
    detector.arm(IN_MOTION, 0.7, 5.0)
    event, when = feed(detector, arm, 0.7, 1.5, ramp(direction, 1.0, newton))
    assert event is not None and event.source == MOMENTUM and event.code == ReasonCode.CONTACT_FOUND
    assert 1.02 < when <= 1.10
    assert event.confidence >= 0.99 and detector.state() == "off"


def test_no_alarm_without_contact():
    arm, detector = Arm(sigma=0.1), fused()
    assert feed(detector, arm, 0.0, 0.7)[0] is None
    detector.arm(IN_MOTION, 0.7, 60.0)
    assert feed(detector, arm, 0.7, 2.5)[0] is None


def test_a_set_clock_and_a_long_gap_are_no_contact():
    arm, detector = Arm(sigma=0.1), fused()
    feed(detector, arm, 0.0, 0.7)
    detector.arm(IN_MOTION, 0.7, 2.0)
    assert feed(detector, arm, 0.7, 1.0)[0] is None
    assert feed(detector, arm, 1.3, 1.6)[0] is None  # 0.3 s without a sample
    for shift in (1000.0, -1000.0):
        assert feed(detector, arm, 1.6, 1.9, shift=shift)[0] is None
        assert detector.state() == "watching"
    event, _ = feed(detector, arm, 1.9, 2.6, ramp((0, 1, 0), 2.3), shift=-1000.0)
    assert event is not None


def test_a_set_payload_is_no_contact_and_an_unknown_one_is():
    for told in (True, False):
        before, after, detector = Arm(begin=99.0), Arm(begin=99.0, mass=0.5), fused()
        feed(detector, before, 0.0, 0.7)
        detector.arm(IN_MOTION, 0.7, 5.0)
        assert feed(detector, before, 0.7, 1.0)[0] is None
        if told:
            detector.set_payload(0.5)
        for k in range(200, 300):
            q, _, tau = after.at(k * DT)
            event = detector.feed_measured(k * DT, q, tau)
            if event is not None:
                break
        assert (event is None) == told


def test_an_object_touching_before_arming_is_contact():
    arm, detector = Arm(rate=1.2), fused()
    force = lambda t: (0.0, 8.0, 0.0) if t > 0.9 else (0.0, 0.0, 0.0)  # noqa: E731
    feed(detector, arm, 0.0, 1.6, force)
    detector.arm(IN_MOTION, 1.6, 5.0)
    event, when = feed(detector, arm, 1.6, 2.0, force)
    assert event is not None and event.code == ReasonCode.CONTACT_CAME_EARLY and when < 1.62


def test_learning_from_motions_and_its_file(tmp_path):
    moving, runs = MovingContact(Thresholds.load(SHIPPED), cc.ArmDynamics(URDF), jacobian), []
    arm, recorder = Arm(rate=3.0, sigma=0.1), MotionRecorder(moving)
    for k in range(600):
        q, _, tau = arm.at(k * DT)
        moving.feed(k * DT, q, tau)
        recorder.look()
    recorder.end()
    runs = recorder.reaches
    with pytest.raises(ThresholdError, match="at least 20"):
        recorder.learn()
    pieces = [runs[0][k : k + 20] for k in range(0, 400, 20)]
    learnt = learn(pieces)
    assert learnt.variance.shape == (7, len(FEATURES)) and 3.0 < learnt.limit < 30.0
    file = tmp_path / "thresholds.yaml"
    learnt.save(file)
    again = Thresholds.load(file)
    assert np.allclose(again.variance, learnt.variance, rtol=1e-4) and again.reaches == 20
    file.write_text(file.read_text().replace("limit:", "limits:", 1))
    with pytest.raises(ThresholdError, match="limit"):
        Thresholds.load(file)


def test_in_motion_without_a_model_is_refused():
    detector = FusedDetector(ContactDetector(DetectorSettings(), jacobian), None)
    with pytest.raises(ValueError, match="model"):
        detector.arm(IN_MOTION, 0.0, 1.0)
    assert detector.feed_measured(0.0, np.zeros(7), np.zeros(7)) is None


def test_the_weight_arrives_at_a_lifting_arm():
    """Counted from the load on arming, while the arm moves."""
    arm, detector = Arm(rate=0.3, sigma=0.05), fused()
    share = lambda t: 0.2 if t < 1.5 else min(1.0, 0.2 + (t - 1.5) / 0.3)  # noqa: E731
    weight = lambda t: (0.0, 0.0, -0.31 * 9.81 * share(t))  # noqa: E731
    assert feed(detector, arm, 0.0, 1.0, weight)[0] is None
    detector.arm(LIFT, 1.0, 4.0, mass=0.31, load_share=0.5)
    event, when = feed(detector, arm, 1.0, 3.0, weight)
    assert event is not None and event.code == ReasonCode.LOAD_CARRIED and event.contact
    # Half of the weight has come after 0.15 s; the residual's lag and the confirmation add 0.1 s.
    assert 1.65 < when < 1.80
    assert detector.moving.load == pytest.approx(0.31) and detector.state() == "off"


def test_a_lift_without_weight_ends_at_its_limit_and_needs_a_mass():
    arm, detector = Arm(rate=0.3, sigma=0.05), fused()
    feed(detector, arm, 0.0, 1.0)
    for mass, timeout in ((0.0, 1.0), (0.3, 0.0), (np.nan, 1.0)):
        with pytest.raises(ValueError, match="mass"):
            detector.arm(LIFT, 1.0, timeout, mass=mass)
    detector.arm(LIFT, 1.0, 0.5, mass=0.31)
    assert feed(detector, arm, 1.0, 2.0)[0] is None
    assert detector.state() == "off"


def delays(pushes, newton, **arm):
    """Delays (s) from sideways pushes, at many moments of the swing, to their events; inf: none, or too early."""
    found = []
    for seed in range(pushes):
        moving, detector, begin = ArmAsMeasured(rate=2.0, seed=seed, **arm), fused(), 1.0 + 0.02 * seed
        direction = (0.0, np.cos(seed), np.sin(seed))
        feed(detector, moving, 0.0, 0.7)
        detector.arm(IN_MOTION, 0.7, 5.0)
        event, when = feed(detector, moving, 0.7, begin + 0.3, ramp(direction, begin, newton))
        found.append(when - begin if event is not None and when > begin else np.inf)
    return np.array(found)


def test_lateral_three_newtons_are_detected_in_time_at_reaching_speed():
    """A ramp has 1 N after 20 ms and is detected within 80 ms of that; joints move at up to 1.4 rad/s."""
    found = delays(40, 3.0, lag=Thresholds.load(SHIPPED).lag)
    assert np.mean(found <= 0.1001) >= 0.9, np.sort(found)


def test_a_learnt_lag_of_the_torques_is_no_push():
    lag = 0.002
    moving = MovingContact(Thresholds.load(SHIPPED), cc.ArmDynamics(URDF), jacobian)
    recorder, arm = MotionRecorder(moving), ArmAsMeasured(lag=lag, rate=4.0)
    for k in range(1200):
        q, _, tau = arm.at(k * DT)
        moving.feed(k * DT, q, tau)
        recorder.look()
    recorder.end()
    run = recorder.reaches[0]
    learnt = learn([run[k : k + 40] for k in range(0, 1000, 40)], lag=moving.thresholds.lag)
    assert learnt.lag == pytest.approx(lag, rel=0.1)
    worst = []
    for thresholds in (replace(learnt, lag=0.0), learnt):
        moving.use(thresholds)
        moving.observer.reset()
        exact = ArmAsMeasured(lag=lag, sigma=0.0, rate=4.0)
        residuals = []
        for k in range(400):
            q, _, tau = exact.at(k * DT)
            moving.feed(k * DT, q, tau)
            residuals.append(np.zeros(7) if moving.residual is None else moving.residual.torque)
        worst.append(np.abs(residuals).max())
    assert worst[1] < 0.2 * worst[0], worst


@pytest.mark.parametrize("share", [0.7, 1.3])
def test_an_object_with_a_wrong_mass_in_its_file_is_no_contact(share):
    for seed in range(6):
        arm, detector = ArmAsMeasured(rate=3.2, seed=seed, mass=0.53 * share), fused()
        detector.set_payload(0.53)
        assert feed(detector, arm, 0.0, 0.7)[0] is None
        detector.arm(IN_MOTION, 0.7, 60.0)
        event, when = feed(detector, arm, 0.7, 3.0)
        assert event is None, (seed, when, event.message)


def test_a_carried_object_is_no_early_contact_after_a_motion():
    """The controller's estimate ignores the payload, and shows it on other joints after the motion."""
    detector, mass = fused(), 2.0
    detector.set_payload(mass)
    arm, weight, stops = Arm(rate=1.0, begin=1.2, mass=mass), np.array([0.0, 0.0, -9.81 * mass]), 1.2 + np.pi / 2.0
    for k in range(round(3.6 / DT)):
        t = k * DT
        if t < stops:
            q, v, tau = arm.at(t)
        else:
            v = np.zeros(7)
            tau = arm.true.evaluate(q, v).gravity
        if k == round(1.15 / DT):
            detector.arm(IN_MOTION, t, 30.0)
        event = detector.feed_measured(t, q, tau)
        event = event or detector.feed(t, jacobian(q).T @ weight, q, v)
        assert event is None, (t, event.message)
    assert detector.still.state() == "watching"


STEP = 1.0 / 128.0

PALM = np.hstack([np.eye(3), np.zeros((3, 4))])
"""m/rad: each of the first three joints measures one axis"""


class Plain:
    """Terms of an arm with this inertia (kg m^2), gravity (Nm) and transposed C (Nm s)."""

    def __init__(self, inertia=0.0, gravity=0.0, coupling=0.0):
        self.inertia, self.gravity, self.coupling, self.payloads = inertia, gravity, coupling, []

    def evaluate(self, q, v):
        return SimpleNamespace(
            momentum=self.inertia * v, transposed=self.coupling * v, gravity=np.full(7, float(self.gravity))
        )

    def set_payload(self, mass, centre):
        self.payloads.append((mass, tuple(centre)))


def seven(value):
    return np.full(7, float(value))


def test_late_stamps_are_no_push_if_the_robots_time_is_known():
    """A fast motion without contact; one sample in twenty is received up to 0.4 s late, as on a busy computer."""
    rng, observer = np.random.default_rng(5), MomentumObserver(Plain(2.0), period=STEP)
    time = STEP * np.arange(600)
    position, velocity = 0.3 * np.sin(4.0 * time), 1.2 * np.cos(4.0 * time)
    torque = 2.0 * np.diff(velocity, prepend=velocity[0]) / STEP
    late = np.where(rng.random(600) < 0.05, rng.uniform(0.0, 0.4, 600), rng.exponential(8e-4, 600))
    stamps = np.maximum.accumulate(time + late) + 1e-6 * np.arange(600)
    found = [observer.feed(s, seven(q), seven(t), m) for s, q, t, m in zip(stamps, position, torque, time, strict=True)]
    assert all(each is not None for each in found[2:])
    assert max(np.abs(each.torque).max() for each in found[2:]) < 0.2, "Nm, of 10 Nm that the motion takes"


def thresholds(constant=0.04, **rest):
    variance = np.zeros((7, len(FEATURES)))
    variance[:, 0] = constant
    return Thresholds(variance, 5.0, seven(0.3), 4.0, **rest)


BAD = {
    "lag: 0.000639": ("lag: 0.0101", "lag: -0.0101", "lag: .nan"),
    "limit: 5.359": ("limit: 0.0", "limit: 1000.0", "limit: .nan"),
    "steady: [0.3, ": ("steady: [-0.3, ", "steady: [.inf, ", "steady: ["),
}


@pytest.mark.parametrize(("good", "bad"), [(good, bad) for good, every in BAD.items() for bad in every])
def test_impossible_thresholds_are_refused(tmp_path, good, bad):
    file, text = tmp_path / "thresholds.yaml", SHIPPED.read_text()
    assert text.count(good) == 1 or good.startswith("limit")
    file.write_text(text.replace("\n" + good, "\n" + bad))
    with pytest.raises((ThresholdError, ValueError)):
        Thresholds.load(file)
    file.write_text(text.replace("lag: 0.000639", "lag: 0.01").replace("reaches: 400\n", ""))
    assert (Thresholds.load(file).lag, Thresholds.load(file).reaches) == (0.01, 0)


class Moved:
    """A MovingContact on an arm without inertia, fed with positions (rad) and forces on its first joints (N)."""

    def __init__(self, period=STEP):
        self.arm, self.k, self.period = Plain(), 0, period
        self.contact = MovingContact(thresholds(lag=0.002), self.arm, lambda q: PALM)

    def feed(self, force=(0.0, 0.0, 0.0), samples=1, by=0.0):
        """``by``: step (rad) from sample to sample."""
        for _ in range(samples):
            self.k += 1
            self.q = getattr(self, "q", 0.0) + by
            self.contact.feed(self.k * self.period, seven(self.q), -np.array([*force, 0.0, 0.0, 0.0, 0.0]))
        return self.contact


@pytest.mark.parametrize("period", [0.002, 0.005, 0.010])
def test_a_push_at_rest_decays_equally_fast_at_every_period(period):
    contact = (moved := Moved(period)).feed((0.0, 0.0, 0.0), int(1.0 / period))
    moved.feed((0.0, 0.0, -8.0), int(1.0 / period))
    moved.feed((0.0, 0.0, 0.0), int(0.5 / period))
    assert -contact.before_motion()[2] == pytest.approx(8.0 * np.exp(-0.5 / 0.25), abs=0.25)
