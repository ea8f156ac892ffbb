"""Contact and release detection on synthetic torques: sensitivity by direction, false alarms, the
arm-must-stand-still gate."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.contact.detector import ContactDetector, DetectorSettings, confidence, sensitive_joints
from coglab_smach.contact.trials import DT, STILL, ContactTrial, found_within, push
from coglab_smach.kinematics.reachability import default_arm, position_jacobian, solve


@pytest.fixture(scope="module")
def posture():
    q = solve(default_arm(), Pose(np.array([0.78, -0.02, 0.44]), np.array([0.5, 0.5, 0.5, 0.5])))
    assert q is not None
    return q, position_jacobian(default_arm(), q)


def test_lateral_three_newton_found_within_sixty_milliseconds(posture):
    share, median = found_within(posture, (0, 1, 0), 3.0)
    assert share >= 0.95, f"{share:.0%} within 60 ms, median {median * 1000:.0f} ms"


def test_weight_of_an_object_is_found_too(posture):
    assert found_within(posture, (0, 0, -1), 3.0)[0] >= 0.95


def test_forces_along_the_person_robot_line_are_felt_worst(posture):
    lateral = found_within(posture, (0, 1, 0), 2.0, trials=30)[0]
    along = found_within(posture, (-1, 0, 0), 2.0, trials=30)[0]
    assert lateral > along + 0.2


def test_joints_are_chosen_by_the_jacobian(posture):
    chosen = sensitive_joints(posture[1], (1, 0, 0), 0.5)
    across = np.linalg.norm(posture[1][1:], axis=0)
    assert set(chosen) == {j for j in range(7) if across[j] >= 0.5 * across.max()}
    assert 6 not in chosen and len(chosen) >= 2


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


def test_watches_only_after_settling(posture):
    run = ContactTrial(posture, 3)
    run.feed(1.0)
    run.feed(0.5, velocity=lambda t: np.full(7, 0.3))
    run.detector.arm("contact", run.t, 10.0)
    run.feed(0.2)
    assert run.detector.state() == "waiting"
    run.feed(0.3)
    assert run.detector.state() == "watching"


def test_arming_ends_by_itself(posture):
    run = ContactTrial(posture, 4)
    run.feed(1.0)
    run.detector.arm("contact", run.t, 0.5)
    assert run.feed(0.6)[0] is None
    assert run.detector.state() == "off"
    assert run.feed(0.3, push((0, 1, 0), 10.0))[0] is None


def test_a_person_who_was_early_is_found_by_the_offset(posture):
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


def test_who_pushed_the_arm_at_rest_and_let_go_has_left_no_offset(posture):
    """The jolts of both are no motion, before which the arm would have rested with that force on it."""
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
    assert run.feed(1.0)[0] is None, "nor after a motion from there"


def test_a_touch_that_jolts_the_arm_is_found_as_a_touch(posture):
    """Nothing was there on arming, and a motion went before."""
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


def test_an_event_says_what_it_is_and_how_sure_it_is(posture):
    """A push far over the threshold is certain; the weight that has just come to its share is a matter of noise."""
    run = ContactTrial(posture, 8)
    run.rest_and_arm()
    touch, _ = run.feed(1.0, push((0, 1, 0), 8.0))
    assert (touch.code, touch.source) == (ReasonCode.CONTACT_FOUND, "joint_torque")
    assert (
        touch.confidence == pytest.approx(confidence((touch.margin - 1.0) * DetectorSettings().k))
        and 0.5 < touch.confidence <= 1.0
    )
    run.detector.arm("load", run.t, 10.0, mass=0.5)
    load, _ = run.feed(3.0, lambda t: (0.0, 0.0, -0.5 * 9.81))
    assert load.code == ReasonCode.LOAD_CARRIED and 0.5 <= load.confidence <= 1.0
    run.detector.arm("release", run.t, 10.0, mass=0.5)
    run.feed(0.2, lambda t: (0.0, 0.0, -0.5 * 9.81))
    gone, _ = run.feed(3.0)
    assert gone.code == ReasonCode.LOAD_RELEASED and 0.5 <= gone.confidence <= 1.0
    assert [confidence(d) for d in (0.0, 10.0)] == pytest.approx([0.5, 1.0])


def test_only_one_event_per_arming(posture):
    run = ContactTrial(posture, 6)
    run.rest_and_arm()
    assert run.feed(0.3, push((0, 1, 0), 5.0))[0] is not None
    assert run.feed(0.3, push((0, -1, 0), 9.0))[0] is None


@pytest.mark.parametrize("mass", [0.2, 0.31, 0.8])
def test_release_is_found_when_the_load_leaves(posture, mass):
    weight = mass * 9.81
    held = lambda t: (0, 0, -weight)  # noqa: E731
    for seed in range(20):
        run = ContactTrial(posture, seed)
        run.feed(1.5, held)
        run.detector.arm("release", run.t, 10.0, mass=mass, load_share=0.6)
        assert run.feed(1.0, held)[0] is None, "released while the robot carried it all"
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
        assert trial.feed(1.0, pressing)[0] is None, "a person who only presses does not carry less"
        event, delay = trial.feed(1.0, lambda t: (0, 0, -weight * min(1.0, t / 0.3)))
        assert event is not None and event.contact and delay < 0.5


def test_requests_that_make_no_sense_are_refused():
    detector = ContactDetector(DetectorSettings(), lambda q: np.zeros((3, 7)))
    for arguments in (("touch", 0.0, 1.0), ("contact", 0.0, 0.0), ("release", 0.0, 1.0), ("load", 0.0, 1.0)):
        with pytest.raises(ValueError):
            detector.arm(*arguments)
    with pytest.raises(ValueError, match="1..7"):
        detector.arm("contact", 0.0, 1.0, joints=[0])


@pytest.mark.parametrize("which", ["torque", "position", "velocity"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308, -1e308, "six", "eight"])
@pytest.mark.parametrize("armed", [False, True])
def test_a_sample_that_no_arm_can_give_is_ignored_and_the_push_after_it_found(posture, which, value, armed):
    trial = ContactTrial(posture, 3)
    sample = {"torque": np.zeros(7), "position": trial.q, "velocity": np.zeros(7)}
    sample[which] = (
        {"six": np.zeros(6), "eight": np.zeros(8)}.get(value) if isinstance(value, str) else np.full(7, value)
    )
    trial.detector._jacobian = lambda q: trial.jacobian * (1.0 if np.all(np.abs(q) < 10.0) else np.nan)
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


def test_nan_and_old_stamps_are_ignored(posture):
    run = ContactTrial(posture, 8)
    run.rest_and_arm()
    assert run.detector.feed(run.t + 0.005, [np.nan] * 7, run.q, STILL) is None
    assert run.detector.feed(run.t - 1.0, np.full(7, 50.0), run.q, STILL) is None
    assert run.feed(0.2, push((0, 1, 0), 5.0))[0] is not None


@pytest.mark.parametrize("step", [-3600.0, -0.4, 30.0])
def test_hears_again_after_the_clock_was_set(posture, step):
    """Armed, then the clock steps: the arming keeps the time that it had left, and a touch is still found in time."""
    run = ContactTrial(posture, 21)
    assert run.rest_and_arm() is None
    run.t += step
    assert run.feed(0.6)[0] is None
    assert run.detector.state() == "watching"
    event, delay = run.feed(0.3, push((0, 1, 0), 5.0))
    assert event is not None and delay < 0.06


def test_what_the_detector_sees_can_be_looked_at(posture):
    """The largest change since the last look, the thresholds that it would compare with, and which joints count."""
    run = ContactTrial(posture, 3)
    run.feed(1.0)
    quiet = run.detector.look()
    assert quiet.state == "off" and quiet.mode == "" and quiet.margin == 0.0 and all(quiet.watched)
    assert quiet.rest_samples >= run.detector.settings.learn_samples
    assert np.allclose(quiet.threshold, run.detector.settings.k * run.detector.sigma())
    run.detector.arm("contact", run.t, 30.0, k=9.0)
    run.feed(0.1)
    run.detector.look()
    event, _ = run.feed(0.5, push((0, 1, 0), 8.0))
    assert event is not None
    pushed = run.detector.look()
    assert max(np.abs(pushed.change)) > 3.0 * max(np.abs(quiet.change))
    assert max(np.abs(run.detector.look().change)) == 0.0  # nothing came since


def test_the_noise_is_learnt_anew_at_rest_alone(posture):
    run = ContactTrial(posture, 4)
    with pytest.raises(ValueError, match="at rest"):
        run.detector.learn()
    run.feed(1.0)
    assert "100 samples" in run.detector.learn() and run.detector.look().rest_samples == 0
    run.detector.arm("contact", run.t, 30.0)
    with pytest.raises(ValueError, match="armed for contact"):
        run.detector.learn()
    run.feed(0.2)
    assert run.detector.state() == "waiting"  # until enough was seen
    run.feed(1.0)
    assert run.detector.state() == "watching" and all(
        mine == (j in run.detector._armed.watched) for j, mine in enumerate(run.detector.look().watched)
    )
    moving = ContactTrial(posture, 5)
    moving.feed(1.0)
    moving.feed(0.1, velocity=lambda t: np.full(7, 0.1))
    with pytest.raises(ValueError, match="moves"):
        moving.detector.learn()
