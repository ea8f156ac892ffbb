"""Recognition of reaching patterns: the filter against brute force, earliness, unknown motions,
hysteresis."""

import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from coglab_perception.hmm import LeftRightHmm
from coglab_perception.recogniser import (
    UNKNOWN,
    Recogniser,
    RecogniserSettings,
    load_patterns,
    save_patterns,
    train_patterns,
)
from synthetic_reaches import ENDS, demonstrations, reach


@pytest.fixture(scope="module")
def patterns():
    return train_patterns(demonstrations(20, seed=1))


def small_model(rng, n=3, d=2):
    stay = np.append(rng.uniform(0.3, 0.9, n - 1), 1.0)
    return LeftRightHmm(stay, rng.normal(size=(n, d)), rng.uniform(0.2, 1, (n, d)))


def test_the_filter_equals_the_sum_over_all_paths():
    rng = np.random.default_rng(0)
    for _ in range(20):
        model = small_model(rng)
        x = rng.normal(size=(6, 2))
        a, log_b = model.transition(), model.log_emission(x)
        total = 0.0
        for path in itertools.product(range(3), repeat=6):
            if path[0] != 0:
                continue
            p = np.exp(log_b[0, 0])
            for t in range(1, 6):
                p *= a[path[t - 1], path[t]] * np.exp(log_b[t, path[t]])
            total += p
        assert model.log_likelihood(x) == pytest.approx(np.log(total), abs=1e-9)


def test_training_raises_the_likelihood_and_finds_the_means():
    rng = np.random.default_rng(1)
    truth = LeftRightHmm([0.8, 0.8, 1.0], [[0.0], [3.0], [6.0]], [[0.2], [0.2], [0.2]])
    data = []
    for _ in range(40):
        state, frames = 0, []
        for _ in range(25):
            frames.append(truth.mean[state] + np.sqrt(truth.variance[state]) * rng.normal(size=1))
            if state < 2 and rng.random() > truth.stay[state]:
                state += 1
        data.append(np.array(frames))
    model = LeftRightHmm.train(data, 3)
    assert model.mean[:, 0] == pytest.approx([0, 3, 6], abs=0.15)
    assert model.stay[:2] == pytest.approx([0.8, 0.8], abs=0.06)


def outcome_at(patterns, name, rng, share):
    recogniser = Recogniser(patterns)
    stamps, positions, onset, duration = reach(name, rng)
    switches, last = 0, UNKNOWN
    at_share = None
    for t, p in zip(stamps, positions, strict=False):
        estimate = recogniser.update(t, p)
        if at_share is None and t >= onset + share * duration:
            at_share = estimate
        if estimate.decided and estimate.pattern != last:
            switches += estimate.pattern != name
            last = estimate.pattern
    return at_share, switches


def test_right_after_forty_per_cent_of_the_reach_and_hardly_ever_wrong(patterns):
    rng = np.random.default_rng(77)
    right = wrong = total = 0
    for name in ENDS:
        for _ in range(60):
            estimate, switches = outcome_at(patterns, name, rng, 0.4)
            right += estimate.pattern == name
            wrong += switches > 0
            total += 1
    assert right / total >= 0.95, f"{right} of {total} right after 40 %"
    assert wrong / total <= 0.01, f"{wrong} of {total} with a wrong decision"


def test_a_motion_that_is_no_reach_is_unknown(patterns):
    rng = np.random.default_rng(6)
    decided = 0
    for _ in range(40):
        recogniser = Recogniser(patterns)
        away = np.array([1.30, 0.20, 0.15]) + rng.normal(0, 0.02, 3)
        direction = np.array([0.5, rng.uniform(-0.2, 0.2), -0.2])
        for k in range(60):
            t = k / 30
            s = min(1.0, max(0.0, (t - 0.6) / 0.9))
            recogniser.update(t, away + direction * s**3 * (10 - 15 * s + 6 * s * s) + rng.normal(0, 0.004, 3))
        decided += recogniser.estimate.decided
    assert decided == 0


def test_nothing_is_decided_while_the_hand_rests(patterns):
    rng = np.random.default_rng(8)
    recogniser = Recogniser(patterns)
    for k in range(600):
        assert not recogniser.update(k / 30, np.array([1.3, 0.2, 0.15]) + rng.normal(0, 0.004, 3)).decided


def test_a_decision_needs_several_confident_frames(patterns):
    rng = np.random.default_rng(9)
    recogniser = Recogniser(patterns, RecogniserSettings(frames=5))
    streak = 0
    stamps, positions, _, _ = reach("high", rng)
    for t, p in zip(stamps, positions, strict=False):
        estimate = recogniser.update(t, p)
        best = max(estimate.probabilities.values(), default=0.0)
        streak = streak + 1 if best >= 0.9 else 0
        if estimate.decided:
            assert streak >= 5
            break
    assert recogniser.estimate.decided


def test_gaps_and_old_frames_do_no_harm(patterns):
    rng = np.random.default_rng(10)
    recogniser = Recogniser(patterns)
    stamps, positions, _, _ = reach("left", rng)
    for i, (t, p) in enumerate(zip(stamps, positions, strict=False)):
        if i % 3 != 1:
            recogniser.update(t, p)
        recogniser.update(t - 1.0, p + 1.0)
        recogniser.update(t + 0.001, [np.nan, 0, 0])
    assert recogniser.estimate.pattern == "left"


def test_an_estimate_outlives_its_reach_for_a_second_only(patterns):
    rng = np.random.default_rng(11)
    recogniser = Recogniser(patterns)
    stamps, positions, onset, duration = reach("left", rng, hold=4.0)
    kept = 0.0
    for t, p in zip(stamps, positions, strict=False):
        if recogniser.update(t, p).decided:
            kept = t
    over = onset + duration
    assert over + 0.5 < kept < over + 2.5, "kept for a while, then forgotten"
    assert recogniser.estimate.pattern == UNKNOWN and not recogniser.estimate.probabilities
    # The way back is no reach of these patterns, the next reach is recognised like the first.
    stamps, positions, _, _ = reach("high", rng)
    for t, p in zip(stamps + 100.0, positions, strict=False):
        recogniser.update(t, p)
    assert recogniser.estimate.pattern == "high" and recogniser.estimate.decided


def test_a_clock_that_was_set_back_is_a_new_beginning(patterns):
    rng = np.random.default_rng(12)
    recogniser = Recogniser(patterns)
    for begin, name in ((1000.0, "left"), (10.0, "high"), (10.0 - 9.0, "centre")):
        stamps, positions, _, _ = reach(name, rng)
        for t, p in zip(stamps + begin, positions, strict=False):
            recogniser.update(t, p)
        assert recogniser.estimate.pattern == name and recogniser.estimate.decided


def test_pattern_files_round_trip_and_are_checked(patterns, tmp_path):
    path = tmp_path / "p.json"
    save_patterns(str(path), patterns, RecogniserSettings(), "test")
    again, settings = load_patterns(str(path))
    assert [p.name for p in again] == list(ENDS) and settings == RecogniserSettings()
    assert np.array_equal(again[0].model.mean, patterns[0].model.mean)
    for broken, sentence in (("{", "not JSON"), ('{"version": 2}', "version 1"), ('{"version": 1}', "no patterns")):
        path.write_text(broken)
        with pytest.raises(ValueError, match=sentence):
            load_patterns(str(path))
    model = {"name": "x", "floor": 0.0, "stay": [1.0], "mean": [[0.0]], "variance": [[-1.0]]}
    data = {"version": 1, "patterns": [model]}
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match=r"patterns\[0\]"):
        load_patterns(str(path))


def test_too_little_to_train_on_is_said():
    with pytest.raises(ValueError, match="at least 2"):
        train_patterns({"one": demonstrations(1, 3)["high"]})


@pytest.mark.parametrize("fault, step, jump", [("short", 0.0001, 0.0), ("jump", 0.005, 0.2)])
def test_recordings_that_are_no_reach_are_not_trained_with(tmp_path, fault, step, jump) -> None:
    lines = [f"{0.01 * i},{step * i + jump * (i > 50)},0,0" for i in range(100)]
    file = tmp_path / "reach.csv"
    file.write_text("t,x,y,z\n" + "\n".join(lines) + "\n")
    script = Path(__file__).resolve().parents[1] / "scripts" / "train_patterns.py"
    command = [sys.executable, str(script), "-o", str(tmp_path / "p.json"), f"one={file}"]
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    allowed = subprocess.run([*command, "--allow", fault], capture_output=True, text=True, check=False)
    assert refused.returncode == 1 and f"--allow {fault}" in refused.stderr
    assert "--allow" not in allowed.stderr
