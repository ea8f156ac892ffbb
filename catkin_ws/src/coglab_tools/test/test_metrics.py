"""Metrics of a trial equal their closed forms within 1 %."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_tools.report.metrics import METRICS, activities, metrics_of, sparc_of_speed
from trials import measured


def fast_part():
    """Share of a minimum-jerk reach of 0.6 m in 2 s that is faster than 0.05 m/s: 30 s^2 (1 - s)^2 0.3 > 0.05."""
    root = np.sqrt(0.05 / (0.3 * 30.0))
    s = 0.5 - np.sqrt(0.25 - root)
    return 2.0 * (1.0 - 2.0 * s), 3.0 + 2.0 * s


def test_metrics_equal_their_closed_forms():
    found = metrics_of(measured())
    robot, begun = fast_part()
    expected = {
        "duration_s": 10.0, "reaction_s": 2.0, "approach_s": 2.0, "transfer_s": 2.0, "human_idle": 0.8,
        "robot_idle": 1.0 - robot / 10.0, "concurrent_activity": 0.0, "functional_delay": (begun - 3.0) / 10.0,
        "peak_force_n": 6.0, "mean_force_n": 6.0, "impulse_ns": 12.0, "sparc": -1.40, "detection_delay_s": 0.12,
        "peak_palm_speed": 1.875 * 0.3, "nearest_m": 1.0,
    }  # fmt: skip
    assert set(expected) == set(METRICS)
    for name, value in expected.items():
        # the smoothing of the speed moves an edge by up to 30 ms
        assert found[name] == pytest.approx(value, rel=0.01, abs=0.03 if name == "reaction_s" else 0.003), name


def test_the_force_counts_only_while_both_touch_the_object():
    trial = measured()
    trial.person_force = [(t, 3.0 if t < 7.0 else 0.0) for t, _ in trial.person_force]  # holds it from the start
    found = metrics_of(trial)
    assert found["mean_force_n"] == pytest.approx(6.0, rel=0.01)
    assert found["impulse_ns"] == pytest.approx(12.0, rel=0.01)


def test_a_late_stamp_makes_no_fast_palm():
    trial = measured()
    late = int(np.searchsorted([row[0] for row in trial.series.truth], 4.0))
    when = trial.series.truth[late + 1][0] - 0.0003
    trial.series.truth[late] = (when, *trial.series.truth[late][1:])
    assert metrics_of(trial)["peak_palm_speed"] == pytest.approx(1.875 * 0.3, rel=0.05)


@pytest.mark.parametrize("rate", [60.0, 200.0])
def test_sparc_does_not_depend_on_the_rate(rate):
    s = np.arange(0.0, 1.0, 1.0 / (2.0 * rate))
    assert sparc_of_speed(30 * s**2 * (1 - s) ** 2, rate) == pytest.approx(-1.40, rel=0.02)


def test_an_unseen_hand_gives_no_figures_of_the_person():
    trial = measured()
    trial.series.truth = [(t, palm, [np.nan] * 3, thing, np.nan) for t, palm, _, thing, _ in trial.series.truth]
    found = metrics_of(trial)
    assert found["human_idle"] is None and found["nearest_m"] is None and found["peak_force_n"] is None
    assert found["robot_idle"] == pytest.approx(1.0 - fast_part()[0] / 10.0, rel=0.01)
    assert activities(trial)[0] == []


def test_two_actions_of_a_recording_have_their_own_figures():
    trial = measured()
    first = trial.exchanges[0]
    marks = {"motion_started": 6.0, "motion_reached": 8.0, "contact": 9.0, "opening": 9.0}
    trial.exchanges = (first, replace(first, what="give", started=5.5, ended=10.0, marks=marks))
    receive, give = (metrics_of(part) for part in trial.parts())
    assert receive["transfer_s"] == pytest.approx(2.0) and give["transfer_s"] == pytest.approx(1.0)
    assert give["approach_s"] == pytest.approx(2.0) and give["duration_s"] == pytest.approx(4.5)
    assert [part.record.action for part in trial.parts()] == ["exchange_human_to_robot", "exchange_robot_to_human"]
