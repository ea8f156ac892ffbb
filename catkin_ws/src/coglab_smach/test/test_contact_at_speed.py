"""Contact of an arm that moves as fast as in a reach, under sensors' noise, lag and loads of another weight."""

from dataclasses import replace

import coglab_controllers as cc
import numpy as np
import pytest
from coglab_smach.contact.fused_detector import IN_MOTION
from coglab_smach.contact.learning import MotionRecorder
from coglab_smach.contact.motion_thresholds import Thresholds, learn
from coglab_smach.contact.moving_contact import MovingContact
from moving_arm import DT, SHIPPED, URDF, Arm, ArmAsMeasured, feed, fused, jacobian, ramp


def delays(pushes, newton, **arm):
    """s from the begin of pushes aside, at many moments of the swing, to their events; inf: none, or before it."""
    found = []
    for seed in range(pushes):
        moving, detector, begin = ArmAsMeasured(rate=2.0, seed=seed, **arm), fused(), 1.0 + 0.02 * seed
        direction = (0.0, np.cos(seed), np.sin(seed))
        feed(detector, moving, 0.0, 0.7)
        detector.arm(IN_MOTION, 0.7, 5.0)
        event, when = feed(detector, moving, 0.7, begin + 0.3, ramp(direction, begin, newton))
        found.append(when - begin if event is not None and when > begin else np.inf)
    return np.array(found)


def test_three_newtons_across_are_found_in_time_at_the_speeds_of_a_reach():
    """A ramp has 1 N after 20 ms and is found within 80 ms of that; joints at up to 1.4 rad/s."""
    found = delays(40, 3.0, lag=Thresholds.load(SHIPPED).lag)
    assert np.mean(found <= 0.1001) >= 0.9, np.sort(found)


def test_torques_that_lag_behind_positions_are_no_push_once_that_is_learnt():
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
def test_an_object_that_is_not_as_heavy_as_its_file_says_is_no_contact(share):
    for seed in range(6):
        arm, detector = ArmAsMeasured(rate=3.2, seed=seed, mass=0.53 * share), fused()
        detector.set_payload(0.53)
        assert feed(detector, arm, 0.0, 0.7)[0] is None
        detector.arm(IN_MOTION, 0.7, 60.0)
        event, when = feed(detector, arm, 0.7, 3.0)
        assert event is None, (seed, when, event.message)


def test_what_an_arm_carries_is_no_early_contact_where_it_comes_to_rest():
    """The controller's estimate does not know of the load, and feels it elsewhere after the motion."""
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
