"""Contact of a moving arm: momentum observer, learnt thresholds, evidence and the one event, on analytic motions."""

from dataclasses import dataclass

import coglab_controllers as cc
import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.contact.evidence import (
    FUSED,
    MOMENTUM,
    SIGHT,
    TACTILE,
    Evidence,
    Fingers,
    InPalm,
    Touch,
    name_of,
    together,
)
from coglab_smach.contact.fused_detector import IN_MOTION, LIFT, FusedDetector
from coglab_smach.contact.learning import MotionRecorder
from coglab_smach.contact.momentum_observer import MomentumObserver
from coglab_smach.contact.motion_thresholds import FEATURES, ThresholdError, Thresholds, learn
from coglab_smach.contact.moving_contact import MovingContact
from coglab_smach.kinematics.reachability import home_posture
from moving_arm import DT, SHIPPED, URDF, Arm, feed, fused, jacobian, ramp


def test_terms_of_the_arm_obey_their_definitions():
    dynamics, rng = cc.ArmDynamics(URDF), np.random.default_rng(5)
    for _ in range(20):
        q, v = rng.uniform(-1.5, 1.5, (2, 7))
        terms = dynamics.evaluate(q, v)
        assert np.allclose(terms.momentum, terms.mass @ v, atol=1e-12)
        energy = [[0.5 * v @ dynamics.evaluate(q + h * axis, v).mass @ v for h in (-1e-5, 1e-5)] for axis in np.eye(7)]
        # C^T q' with Christoffel's symbols is the gradient of the kinetic energy.
        assert np.allclose(terms.transposed, [(b - a) / 2e-5 for a, b in energy], atol=1e-6)
        assert v @ terms.coriolis == pytest.approx(v @ terms.transposed, abs=1e-6)


def test_a_payload_is_what_its_weight_says():
    bare, loaded = cc.ArmDynamics(URDF), cc.ArmDynamics(URDF)
    loaded.set_payload(0.5, [0.0, 0.0, 0.0])
    q = home_posture()
    added = loaded.evaluate(q, np.zeros(7)).gravity - bare.evaluate(q, np.zeros(7)).gravity
    assert np.allclose(added, jacobian(q).T @ [0.0, 0.0, 0.5 * 9.81], atol=1e-9)
    j = jacobian(q)
    assert np.allclose(loaded.evaluate(q, np.zeros(7)).mass - bare.evaluate(q, np.zeros(7)).mass, 0.5 * j.T @ j)
    for mass in (-0.1, np.nan):
        with pytest.raises(ValueError, match="mass"):
            bare.set_payload(mass, [0.0, 0.0, 0.0])


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


def test_what_is_no_number_and_short_gaps_leave_the_estimate_alone():
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


def test_stamps_that_jitter_are_whole_periods():
    arm, rng = Arm(begin=0.0), np.random.default_rng(3)
    observer, worst = MomentumObserver(cc.ArmDynamics(URDF), period=DT), 0.0
    for k in range(150):
        q, _, tau = arm.at(k * DT)
        residual = observer.feed(k * DT + rng.uniform(-0.0012, 0.0012), q, tau)
        worst = max(worst, 0.0 if residual is None else float(np.max(np.abs(residual.torque))))
    assert worst < 0.05


def test_a_stamp_that_could_be_of_either_period_is_no_push():
    """As a computer under load stamps: some samples half a period late. Without a word of it they are 27 Nm."""
    arm, rng = Arm(begin=0.0), np.random.default_rng(5)
    observer, worst = MomentumObserver(cc.ArmDynamics(URDF), period=DT), 0.0
    for k in range(400):
        q, _, tau = arm.at(k * DT)
        late = rng.uniform(0.4, 0.9) * DT if k % 23 == 7 else 0.0
        residual = observer.feed(k * DT + late, q, tau)
        worst = max(worst, 0.0 if residual is None else float(np.max(np.abs(residual.torque))))
    assert worst < 2.5, worst


@pytest.mark.parametrize(("direction", "newton"), [((0, 1, 0), 4.0), ((0, -0.7, 0.7), 6.0), ((0, 0, -1), 6.0)])
def test_a_push_on_the_moving_arm_is_found_within_eighty_milliseconds(direction, newton):
    arm, detector = Arm(sigma=0.1), fused()
    assert feed(detector, arm, 0.0, 0.7)[0] is None
    detector.arm(IN_MOTION, 0.7, 5.0)
    event, when = feed(detector, arm, 0.7, 1.5, ramp(direction, 1.0, newton))
    assert event is not None and event.source == MOMENTUM and event.code == ReasonCode.CONTACT_FOUND
    assert 1.02 < when <= 1.10
    assert event.confidence >= 0.99 and detector.state() == "off"


def test_a_push_at_rest_is_found_too_and_nothing_without_one():
    arm, detector = Arm(begin=99.0, sigma=0.05), fused()
    assert feed(detector, arm, 0.0, 1.0)[0] is None
    detector.arm(IN_MOTION, 1.0, 5.0)
    event, when = feed(detector, arm, 1.0, 2.0, ramp((0, 1, 0), 1.5))
    assert event is not None and 1.5 < when <= 1.6


def test_no_alarm_without_contact():
    arm, detector = Arm(sigma=0.1), fused()
    assert feed(detector, arm, 0.0, 0.7)[0] is None
    detector.arm(IN_MOTION, 0.7, 60.0)
    assert feed(detector, arm, 0.7, 2.5)[0] is None


def test_a_clock_that_is_set_and_a_long_gap_are_no_contact():
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


def test_a_mass_that_was_told_is_no_contact_and_an_untold_one_is():
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


def test_the_load_that_was_felt_is_carried_in_the_model():
    arm, detector = Arm(begin=99.0, sigma=0.02), fused()
    feed(detector, arm, 0.0, 1.0)
    detector.arm("contact", 1.0, 5.0)
    feed(detector, arm, 1.0, 1.5)
    detector.arm("load", 1.5, 5.0, mass=0.5)
    event, _ = feed(detector, arm, 1.5, 3.0, lambda t: (0.0, 0.0, -0.5 * 9.81 if t > 2.0 else 0.0))
    assert event is not None and event.code == ReasonCode.LOAD_CARRIED
    assert detector.moving.load == 0.5


def test_an_object_that_was_there_before_anybody_watched_is_contact():
    arm, detector = Arm(rate=1.2), fused()
    force = lambda t: (0.0, 8.0, 0.0) if t > 0.9 else (0.0, 0.0, 0.0)  # noqa: E731
    feed(detector, arm, 0.0, 1.6, force)
    detector.arm(IN_MOTION, 1.6, 5.0)
    event, when = feed(detector, arm, 1.6, 2.0, force)
    assert event is not None and event.code == ReasonCode.CONTACT_CAME_EARLY and when < 1.62


@dataclass
class Motor:
    """As MotorStatus."""

    position: int = 40
    current: int = 0
    force: int = 5
    moving: bool = False
    target_reached: bool = False
    over_current: bool = False


def test_touch_alone_is_contact_also_of_what_lies_in_the_palm():
    detector = fused()
    detector.arm(IN_MOTION, 0.0, 5.0)
    free, pressed = [[0.05, 0, 0]] * 3, [[0, 0, 0], [0.8, 0.0, 0.3], [0, 0, 0]]
    assert detector.feed_touch(0.0, free, 0.05) is None
    assert detector.feed_touch(0.01, [[np.nan, 0, 0]], 0.05) is None
    assert detector.feed_touch(0.02, pressed, 0.05) is None  # one sample is none
    event = detector.feed_touch(0.03, pressed, 0.05)
    assert event is not None and event.source == TACTILE
    assert detector.feed_touch(0.04, pressed, 0.05) is None  # one event for one arming


def test_what_a_hand_feels_that_says_it_holds_something_is_no_contact():
    """Taken from the board, an object was never told as a payload."""
    detector = fused()
    detector.arm(IN_MOTION, 0.0, 5.0)
    pressed = [[0, 0, 0], [0.8, 0.0, 0.3], [0, 0, 0]]
    detector.holds = True
    assert all(detector.feed_touch(0.01 * i, pressed, 0.05) is None for i in range(4))
    detector.holds = False
    assert detector.feed_touch(0.05, pressed, 0.05) is None  # what was felt before does not count
    assert detector.feed_touch(0.06, pressed, 0.05) is not None


def test_fingers_that_stop_early_or_are_moved_are_contact():
    for change, named in (({"position": 60}, "moved"), ({"force": 60}, "strained")):
        fingers = Fingers()
        assert fingers.feed(0.0, [Motor(), Motor()]).margin == 0.0
        evidence = fingers.feed(0.2, [Motor(), Motor(**change)])
        assert evidence.margin >= 1.0 and named in evidence.message
    fingers = Fingers()
    fingers.feed(0.0, [Motor(moving=True, current=100)])
    assert fingers.feed(0.2, [Motor(position=90, moving=True, current=100)]).margin == 0.0  # it closes
    assert fingers.feed(0.4, [Motor(position=95, over_current=True)]).margin > 1.0
    fingers.feed(0.6, [Motor(moving=True)])
    assert fingers.feed(0.8, [Motor(position=200, target_reached=True)]).margin == 0.0


def test_a_current_counts_once_the_next_status_has_it_too():
    """The command to close falls between the readings of one status: it shows the current and no motion yet."""
    fingers = Fingers()
    fingers.feed(0.0, [Motor(), Motor()])
    assert fingers.feed(0.03, [Motor(), Motor(current=200)]).margin < 1.0
    assert fingers.feed(0.06, [Motor(), Motor(current=200, moving=True)]).margin < 1.0
    fingers = Fingers()
    fingers.feed(0.0, [Motor(), Motor()])
    fingers.feed(0.03, [Motor(), Motor(current=200)])
    evidence = fingers.feed(0.06, [Motor(), Motor(current=200)])  # told to move, and something stands in its way
    assert evidence.margin >= 1.0 and "motor 1" in evidence.message and "current" in evidence.message


def test_two_sources_that_are_nearly_sure_are_a_contact_together():
    one, two = (Evidence(name, 0.0, 1.0, 0.85) for name in (MOMENTUM, TACTILE))
    assert one.probability < 0.99 <= together([one, two])
    assert name_of([one, two]) == FUSED and name_of([one]) == MOMENTUM
    assert name_of([one, Evidence(TACTILE, 0.0, 1.0, 0.1)]) == MOMENTUM
    assert Touch().feed(0.0, []) is None


def test_learning_from_motions_and_the_file_of_it(tmp_path):
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


def test_without_a_model_in_motion_is_refused():
    detector = FusedDetector(ContactDetector(DetectorSettings(), jacobian), None)
    with pytest.raises(ValueError, match="model"):
        detector.arm(IN_MOTION, 0.0, 1.0)
    assert detector.feed_measured(0.0, np.zeros(7), np.zeros(7)) is None


def test_the_weight_comes_to_an_arm_that_lifts():
    """Counted from arming on, whatever was carried then; the arm moves meanwhile."""
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


def test_a_lift_without_a_weight_ends_with_its_time_and_asks_for_a_mass():
    arm, detector = Arm(rate=0.3, sigma=0.05), fused()
    feed(detector, arm, 0.0, 1.0)
    for mass, timeout in ((0.0, 1.0), (0.3, 0.0), (np.nan, 1.0)):
        with pytest.raises(ValueError, match="mass"):
            detector.arm(LIFT, 1.0, timeout, mass=mass)
    detector.arm(LIFT, 1.0, 0.5, mass=0.31)
    assert feed(detector, arm, 1.0, 2.0)[0] is None
    assert detector.state() == "off"


def test_an_object_that_is_seen_at_its_grasp_is_contact_once_the_arm_is_slow():
    palm = InPalm()
    assert palm.feed(0.0, 0.005, 0.1, 0.2).margin == 0.0
    assert palm.feed(0.1, 0.005, 0.1, 0.01).margin == 0.0
    assert palm.feed(0.2, 0.005, 0.1, 0.01).margin == 0.0
    assert palm.feed(0.25, 0.005, 0.1, 0.01).margin == 1.0
    assert palm.feed(0.3, 0.03, 0.1, 0.01).margin == 0.0
    assert palm.feed(0.35, np.nan, 0.1, 0.01) is None
    detector = fused()
    detector.arm(IN_MOTION, 0.0, 5.0)
    events = [detector.feed_sight(0.03 * k, 0.008, 0.1, 0.01) for k in range(8)]
    found = [event for event in events if event is not None]
    assert len(found) == 1 and found[0].source == SIGHT and found[0].contact
