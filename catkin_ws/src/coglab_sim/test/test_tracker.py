"""The tracker: latency, noise, dropouts, occlusion, swaps and calibration as configured, and none of it when
perfect."""

import numpy as np
import pytest
from coglab_py.pose import Pose
from coglab_sim.tracker.tracker import Board, PerceptionSettings, Tracker

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


def test_stamp_is_the_capture_time_and_latency_is_as_configured():
    sights = watch(PerceptionSettings())
    delays = np.array([t - s.captured for t, s in sights])
    assert delays.mean() == pytest.approx(0.060, abs=0.01) and delays.min() >= 0.0
    assert all(b[1].captured > a[1].captured for a, b in zip(sights, sights[1:], strict=False))


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


def test_dropouts_come_in_bursts():
    sights = watch(PerceptionSettings(dropout_start=0.05, dropout_end=0.2), 60.0)
    gaps = np.diff([s.captured for _, s in sights])
    assert gaps.max() > 0.15 and len(sights) < 0.95 * 60 * 30


def test_an_identity_swap_shows_the_nearest_other_thing_and_comes_back():
    quiet = {"position_noise": (0, 0, 0), "orientation_noise": 0.0, "dropout_start": 0.0}
    settings = PerceptionSettings(**quiet, **CALIBRATED | {"swap_probability": 0.01})
    hand, far = Pose(np.array([0.9, 0.0, 0.45])), Pose(np.array([0.4, -0.5, 0.1]))
    sights = watch(settings, 60.0, others=(far, hand))
    swapped = [np.allclose(s.frame.position, hand.position) for _, s in sights]
    right = [np.allclose(s.frame.position, [0.8, 0, 0.4]) for _, s in sights]
    assert sum(swapped) >= 8 and all(a != b for a, b in zip(swapped, right, strict=True))
    alone = np.array(
        [np.linalg.norm(s.frame.position - [0.8, 0, 0.4]) for _, s in watch(settings, 60.0, others=(far,))]
    )
    assert alone.max() == pytest.approx(0.08) and np.median(alone) == pytest.approx(0.0, abs=1e-9)


def test_occlusion_by_the_robots_hand_comes_in_bursts():
    settings = PerceptionSettings(dropout_start=0.0)
    far = watch(settings, 60.0, robot=Pose(np.array([0.5, 0, 0.4])))
    near = watch(settings, 60.0, robot=Pose(np.array([0.75, 0, 0.4])))
    hidden = 0.08 / (0.08 + 0.25)
    assert len(near) == pytest.approx((1.0 - hidden) * len(far), rel=0.06)
    assert np.diff([s.captured for _, s in near]).max() > 0.2


def test_the_calibration_is_off_by_a_constant_for_all_frames():
    settings = PerceptionSettings(
        position_noise=(0, 0, 0), orientation_noise=0.0, dropout_start=0.0, swap_probability=0.0
    )
    at = np.array([0.75, 0.0, 0.40])
    shifts = []
    for seed in range(20):
        seen = [s.frame for _, s in watch(settings, 2.0, lambda t: Pose(at), seed=seed)]
        assert all(np.array_equal(frame.position, seen[0].position) for frame in seen)
        metres, angle = seen[0].distance(Pose(at))
        assert metres == pytest.approx(0.005) and np.degrees(angle) == pytest.approx(1.0)
        shifts.append(seen[0].position - at)
        hand = Tracker("human_hand", settings, seed)
        assert hand.calibration.distance(Tracker("object_mug", settings, seed).calibration) == (0.0, 0.0)
    assert np.linalg.norm(np.mean(shifts, axis=0)) < 0.003, "the direction is the seed's"


def test_by_default_nothing_is_spared_and_perfect_switches_all_of_it_off():
    s = PerceptionSettings()
    assert min(s.latency, s.latency_sigma, s.rate_jitter, *s.position_noise, s.orientation_noise) > 0.0
    assert min(s.dropout_start, s.occlusion_distance, s.swap_probability, s.calibration_offset) > 0.0
    assert s.calibration_offset == 0.005 and s.calibration_turn_deg == 1.0
    perfect = PerceptionSettings(perfect=True, swap_probability=0.5, occlusion_distance=1.0, dropout_start=0.5)
    robot = Pose(np.array([0.78, 0.0, 0.4]))
    for t, sight in watch(perfect, 10.0, robot=robot, others=(robot,)):
        assert sight.captured == t and sight.frame.distance(Pose(np.array([0.8, 0.0, 0.4]))) == (0.0, 0.0)


def test_same_seed_same_sights():
    a, b = watch(PerceptionSettings(), 5.0, seed=9), watch(PerceptionSettings(), 5.0, seed=9)
    assert [t for t, _ in a] == [t for t, _ in b]
    assert all(np.array_equal(x.frame.position, y.frame.position) for (_, x), (_, y) in zip(a, b, strict=False))


def test_settings_are_checked():
    with pytest.raises(ValueError, match="unknown fields latncy"):
        PerceptionSettings.from_mapping({"latncy": 0.1})
    with pytest.raises(ValueError, match="rate must be positive"):
        PerceptionSettings(rate=0.0)


def test_free_places_are_those_without_an_object():
    board = Board(Pose(np.array([0.5, -0.5, 0.0])), {"A1": np.zeros(3), "A2": np.array([0.2, 0.0, 0.0])})
    assert board.free([]) == ["A1", "A2"]
    assert board.free([np.array([0.52, -0.5, 0.0])]) == ["A2"]
