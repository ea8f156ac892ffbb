"""What the tracker does frame by frame: its shipped figures, when it captures and delivers, how long a swap lasts, and
what its noise is made of."""

from dataclasses import fields, replace

import numpy as np
import pytest
import yaml
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z
from coglab_sim.tracker import tracker as module
from coglab_sim.tracker.tracker import CALIBRATED_AT, Board, PerceptionSettings, Sight, Tracker

SHIPPED = {
    "perfect": False,
    "rate": 30.0,
    "rate_jitter": 0.003,
    "latency": 0.060,
    "latency_sigma": 0.015,
    "position_noise": (0.004, 0.004, 0.004),
    "orientation_noise": 0.035,
    "correlation_time": 0.50,
    "dropout_start": 0.02,
    "dropout_end": 0.3,
    "occlusion_distance": 0.15,
    "occlusion_start": 0.08,
    "occlusion_end": 0.25,
    "swap_probability": 0.002,
    "swap_jump": 0.08,
    "swap_reach": 0.25,
    "swap_frames": 4,
    "calibration_offset": 0.005,
    "calibration_turn_deg": 1.0,
}
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


def test_the_shipped_figures_are_those_of_the_configuration():
    settings = PerceptionSettings()
    assert {field.name: getattr(settings, field.name) for field in fields(settings)} == SHIPPED
    file = yaml.safe_load(package_path("coglab_sim", "config", "perception.yaml").read_text(encoding="utf-8"))
    assert PerceptionSettings.from_mapping(file["settings"]) == settings
    assert CALIBRATED_AT == pytest.approx([0.75, 0.0, 0.40])


def test_settings_out_of_range_are_refused():
    PerceptionSettings(rate=0.1, latency=0.0)
    for wrong in ({"rate": 0.0}, {"rate": -1.0}, {"rate": float("nan")}, {"latency": -0.001}):
        with pytest.raises(ValueError, match="rate must be positive and latency not negative"):
            PerceptionSettings(**wrong)
    assert PerceptionSettings.from_mapping({"position_noise": [0, 1, 2]}).position_noise == (0, 1, 2)


def captured(settings, times, truth=lambda t: HERE, seed=3, robot=None, others=(), name="object_mug"):
    tracker, found = Tracker(name, settings, seed), []
    for t in times:
        found += [(t, sight) for sight in tracker.step(t, truth(t), robot, others)]
    return found


def test_frames_are_captured_at_the_rate_and_at_once_when_it_is_time():
    times = [0.0, 0.124, 0.125, 0.15, 0.25, 0.5, 0.624, 0.625]
    found = captured(replace(QUIET, rate=8.0), times)
    assert [t for t, _ in found] == [0.0, 0.125, 0.25, 0.5, 0.625]
    assert all(isinstance(sight, Sight) and sight.name == "object_mug" and sight.captured == t for t, sight in found)


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


def test_jitter_never_stops_the_tracker():
    stamps = [s.captured for _, s in captured(replace(QUIET, rate=200.0, rate_jitter=0.02), np.arange(0.0, 2.0, 5e-4))]
    assert 0.0009 <= np.diff(stamps).min() <= 0.0016 and np.std(np.diff(stamps)) > 0.008
    even = [
        s.captured for _, s in captured(replace(QUIET, rate=20.0, perfect=True, rate_jitter=0.5), np.arange(0, 2, 0.01))
    ]
    assert np.diff(even) == pytest.approx([0.05] * (len(even) - 1), abs=0.0101)


def test_bursts_begin_and_end_with_their_probabilities():
    tracker = Tracker("a", QUIET, 1)
    assert tracker._burst(False, 1.0, 0.5) is True and tracker._burst(True, 0.5, 1.0) is False
    assert tracker._burst(False, 0.0, 0.5) is False and tracker._burst(True, 0.0, 0.0) is True
    for lost, start, end, share in ((False, 0.3, 0.9, 0.3), (True, 0.9, 0.2, 0.8)):
        assert np.mean([tracker._burst(lost, start, end) for _ in range(4000)]) == pytest.approx(share, abs=0.03)


def test_dropouts_hide_all_of_a_burst():
    assert captured(replace(QUIET, dropout_start=1.0, dropout_end=0.0), np.arange(0.0, 2.0, 0.01)) == []
    half = captured(replace(QUIET, dropout_start=1.0, dropout_end=1.0, rate=8.0), np.arange(0.0, 4.0, 0.125))
    assert [t for t, _ in half] == list(np.arange(0.125, 4.0, 0.25)), "every second one"


@pytest.mark.parametrize("away, hidden", [(0.149, True), (0.151, False)])
def test_the_robots_hand_hides_what_is_near(away, hidden):
    settings = replace(QUIET, occlusion_distance=0.15, occlusion_start=1.0, occlusion_end=0.0)
    robot = Pose(HERE.position + [0.0, away, 0.0])
    times = np.arange(0.0, 1.0, 0.01)
    assert (captured(settings, times, robot=robot) == []) is hidden
    assert captured(settings, times) != [], "no robot hides nothing"


def test_what_was_hidden_is_seen_again_once_the_hand_is_away():
    settings = replace(QUIET, rate=100.0, occlusion_distance=0.15, occlusion_start=1.0, occlusion_end=0.0)
    tracker = Tracker("a", settings, 1)
    assert tracker.step(0.0, HERE, HERE) == []
    assert len(tracker.step(1.0, HERE, Pose())) == 1


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


def test_a_swap_lasts_four_frames_in_one_place():
    seen = swaps((), swap_frames=4)
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=1)
    assert [i for i, step in enumerate(steps) if step > 1e-9] == [3, 7, 11, 15]
    once = Tracker("a", replace(QUIET, rate=8.0, swap_probability=1.0, swap_frames=4), 1)
    far = []
    for frame in range(8):
        far.append(len(once.step(0.125 * frame, HERE)) and np.linalg.norm(once.newest.frame.position - HERE.position))
        once.settings = replace(once.settings, swap_probability=0.0)
    assert far == pytest.approx([0.08] * 4 + [0.0] * 4)
    gone = Tracker("a", replace(QUIET, rate=10.0, swap_probability=1.0), 1)
    gone.step(0.0, HERE, None, (Pose(HERE.position + [0.1, 0.0, 0.0]),))
    gone.step(0.11, HERE, None, ())
    assert np.linalg.norm(gone.newest.frame.position - HERE.position) == pytest.approx(0.08), "the thing has left"


def test_a_swap_begins_as_often_as_its_probability_says():
    settings = replace(QUIET, rate=1000.0, swap_probability=0.05, swap_frames=1)
    found = captured(settings, np.arange(0.0, 4.0, 0.001))
    moved = [np.linalg.norm(sight.frame.position - HERE.position) > 0.01 for _, sight in found]
    assert np.mean(moved) == pytest.approx(0.05, rel=0.25)


def test_noise_is_about_the_truth_and_keeps_its_share_over_time():
    """Deviations per axis from the first frame on, of positions (m) and turns (rad), correlated over 0.5 s."""
    settings = replace(QUIET, position_noise=(0.004, 0.001, 0.008), orientation_noise=0.035)
    firsts, seconds = [], []
    for seed in range(1500):
        tracker = Tracker("a", settings, seed)
        firsts.append(tracker._noise_step(1.0).copy())
        seconds.append(tracker._noise_step(1.25).copy())
    firsts, seconds = np.array(firsts), np.array(seconds)
    sigma = [0.004, 0.001, 0.008, 0.035, 0.035, 0.035]
    assert firsts.std(axis=0) == pytest.approx(sigma, rel=0.07)
    assert seconds.std(axis=0) == pytest.approx(sigma, rel=0.07)
    share = (firsts * seconds).mean(axis=0) / np.square(sigma)
    assert share == pytest.approx([np.exp(-0.25 / 0.5)] * 6, abs=0.08)
    at_once = Tracker("a", replace(settings, correlation_time=0.0), 1)
    both = [at_once._noise_step(0.01 * i)[0] for i in range(2000)]
    assert np.corrcoef(both[1:], both[:-1])[0, 1] == pytest.approx(0.0, abs=0.07)


def test_noise_turns_what_is_seen_and_moves_it():
    tracker = Tracker("a", replace(QUIET, rate=10.0), 1)
    tracker._noise_step = lambda now: np.array([0.01, 0.02, 0.03, 0.0, 0.0, 0.1])
    turned = Pose(HERE.position, about_z(0.5))
    seen = tracker.step(0.0, turned)[0].frame
    assert seen.position == pytest.approx(HERE.position + [0.01, 0.02, 0.03])
    assert seen.distance(Pose(seen.position, about_z(0.6))) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_calibration_turns_about_the_middle_of_the_handover_region():
    for seed in range(5):
        off = replace(QUIET, calibration_turn_deg=2.0).calibration(seed)
        assert off.apply(CALIBRATED_AT) == pytest.approx(CALIBRATED_AT)
        assert np.degrees(off.rotation.magnitude()) == pytest.approx(2.0)
        shifted = replace(QUIET, calibration_offset=0.01).calibration(seed)
        assert np.linalg.norm(shifted.position) == pytest.approx(0.01) and shifted.rotation.magnitude() < 1e-12
    seen = captured(replace(QUIET, calibration_offset=0.01), [0.0], seed=4)[0][1].frame
    assert seen.position == pytest.approx(
        HERE.position + replace(QUIET, calibration_offset=0.01).calibration(4).position
    )


def test_trackers_of_other_frames_and_seeds_go_other_ways():
    noisy = replace(QUIET, position_noise=(0.01, 0.01, 0.01))
    seen = {(name, seed): Tracker(name, noisy, seed)._noise_step(0.0)[0] for name in ("ab", "cd") for seed in (1, 2)}
    assert len(set(seen.values())) == 4
    assert Tracker("ab", noisy, 1)._noise_step(0.0)[0] == seen["ab", 1]


@pytest.mark.parametrize("away, free", [(0.099, False), (0.101, True)])
def test_a_place_is_free_10_cm_from_every_object(away, free):
    board = Board(Pose(np.array([0.5, -0.5, 0.05]), about_z(np.pi / 2)), {"A1": np.array([0.1, 0.0, 0.0])})
    place = np.array([0.5, -0.4, 0.05])
    assert (board.free([place + [0.0, 0.0, away]]) == ["A1"]) is free
    assert board.free([place + [0.0, 0.0, 1.0], place + [away, 0.0, 0.0]]) == (["A1"] if free else [])
    assert board.free([place + [0.06, 0.0, 0.0]], clearance=0.05) == ["A1"]
    assert module.Board is Board
