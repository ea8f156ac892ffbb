"""The tracker: latency, noise, dropouts, occlusion, swaps and calibration as configured, and none of it when
perfect."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_py.pose import Pose
from coglab_sim.tracker.tracker import PerceptionSettings, Tracker

CALIBRATED = {"calibration_offset": 0.0, "calibration_turn_deg": 0.0, "swap_probability": 0.0}
"""for tests of something else"""


def watch(settings, seconds=20.0, truth=lambda t: Pose(np.array([0.8, 0.0, 0.4])), seed=3, robot=None, others=()):
    tracker = Tracker("object_mug", settings, seed)
    sights = []
    for k in range(int(seconds * 200)):
        t = k * 0.005
        for sight in tracker.step(t, truth(t), robot, others):
            sights.append((t, sight))
    return sights


def test_perfect_perception_is_the_truth_at_the_same_rate():
    moving = lambda t: Pose(np.array([0.8 + 0.1 * t, 0.0, 0.4]))  # noqa: E731
    sights = watch(PerceptionSettings(perfect=True), truth=moving)
    assert len(sights) == pytest.approx(20 * 30, rel=0.15)
    for t, sight in sights:
        assert sight.captured == t
        assert sight.frame.position == pytest.approx(moving(t).position)


def test_noise_per_axis_and_its_correlation():
    settings = PerceptionSettings(
        position_noise=(0.004, 0.001, 0.008),
        correlation_time=0.10,
        dropout_start=0.0,
        latency_sigma=0.0,
        **CALIBRATED,
    )
    points = np.array([s.frame.position for _, s in watch(settings, 200.0)])
    assert points.std(axis=0) == pytest.approx([0.004, 0.001, 0.008], rel=0.25)
    x = points[:, 0] - points[:, 0].mean()
    assert float(x[1:] @ x[:-1] / (x @ x)) == pytest.approx(np.exp(-1 / 30 / 0.1), abs=0.1)


def test_same_seed_same_sights():
    a, b = watch(PerceptionSettings(), 5.0, seed=9), watch(PerceptionSettings(), 5.0, seed=9)
    assert [t for t, _ in a] == [t for t, _ in b]
    assert all(np.array_equal(x.frame.position, y.frame.position) for (_, x), (_, y) in zip(a, b, strict=False))


QUIET = PerceptionSettings(
    rate_jitter=0.0,
    latency=0.0,
    latency_sigma=0.0,
    position_noise=(0.0, 0.0, 0.0),
    orientation_noise=0.0,
    dropout_start=0.0,
    occlusion_distance=0.0,
    swap_probability=0.0,
    calibration_offset=0.0,
    calibration_turn_deg=0.0,
)
"""a tracker without any fault"""
HERE = Pose(np.array([0.8, 0.0, 0.4]))


def captured(settings, times, truth=lambda t: HERE, seed=3, robot=None, others=(), name="object_mug"):
    tracker, found = Tracker(name, settings, seed), []
    for t in times:
        found += [(t, sight) for sight in tracker.step(t, truth(t), robot, others)]
    return found


def test_a_latency_delays_the_delivery_and_not_the_stamp():
    found = captured(replace(QUIET, rate=8.0, latency=0.0625), np.arange(0.0, 2.0, 0.0625 / 4))
    assert len(found) == 16 and all(t - sight.captured == 0.0625 for t, sight in found)


def test_a_frame_that_was_overtaken_is_not_delivered():
    settings = replace(QUIET, rate=50.0, latency=0.1, latency_sigma=0.05)
    found = captured(settings, np.arange(0.0, 20.0, 0.002))
    stamps = [sight.captured for _, sight in found]
    assert stamps == sorted(set(stamps)) and 0.3 * 1000 < len(stamps) < 0.9 * 1000
    delays = np.array([t - sight.captured for t, sight in found])
    assert delays.min() >= 0.0


@pytest.mark.parametrize("away, hidden", [(0.149, True), (0.151, False)])
def test_the_robots_hand_hides_what_is_near(away, hidden):
    settings = replace(QUIET, occlusion_distance=0.15, occlusion_start=1.0, occlusion_end=0.0)
    robot = Pose(HERE.position + [0.0, away, 0.0])
    times = np.arange(0.0, 1.0, 0.01)
    assert (captured(settings, times, robot=robot) == []) is hidden
    assert captured(settings, times) != [], "no robot hides nothing"


def swaps(others, **changes):
    """Positions seen by a tracker that takes something else for it in every frame."""
    settings = replace(QUIET, rate=8.0, swap_probability=1.0, **changes)
    found = captured(settings, np.arange(0.0, 2.5, 0.125), others=others)
    return np.array([sight.frame.position for _, sight in found])


def test_a_swap_shows_the_nearest_thing_within_reach():
    near, nearer = Pose(HERE.position + [0.2, 0.0, 0.0]), Pose(HERE.position + [0.0, 0.1, 0.0])
    assert swaps((near, nearer)) == pytest.approx(np.tile(nearer.position, (20, 1)))
    assert swaps((near,)) == pytest.approx(np.tile(near.position, (20, 1)))
    just, beyond = (Pose(HERE.position + [away, 0.0, 0.0]) for away in (0.249, 0.251))
    assert swaps((just,)) == pytest.approx(np.tile(just.position, (20, 1)))
    away = np.linalg.norm(swaps((beyond,)) - HERE.position, axis=1)
    assert away == pytest.approx([0.08] * 20), "else something at swap_jump from it"
