"""Figures of a handover against their closed forms."""

import numpy as np
import pytest
from coglab.series import Series
from coglab_tools.report.metrics import RATE, metrics_of, sparc, speed_on
from scipy.integrate import quad


def test_sparc_of_a_gaussian_speed_is_its_closed_form() -> None:
    width = 0.15  # s
    times = np.arange(-1.5, 1.5, 1.0 / RATE)
    last = np.sqrt(np.log(20.0) / 2.0) / (np.pi * width)  # Hz, where the spectrum is 0.05 of its value at 0 Hz

    def slope(x: float) -> float:  # of the spectrum exp(-2 pi^2 width^2 f^2) over x = f / last
        a = 2.0 * (np.pi * width * last) ** 2
        return -2.0 * a * x * np.exp(-a * x * x)

    exact = -quad(lambda x: np.hypot(1.0, slope(x)), 0.0, 1.0)[0]
    assert sparc(np.exp(-0.5 * (times / width) ** 2), RATE) == pytest.approx(exact, rel=0.01)
    assert np.isnan(sparc(np.zeros(50), RATE))


def test_figures_of_a_made_up_handover() -> None:
    """The person moves from 1 to 3 s at 0.2 m/s, the palm from 2 to 5 s at 0.1 m/s, and touches at 4 s."""
    times = np.arange(0.0, 8.0, 0.01)
    person = np.clip(times - 1.0, 0.0, 2.0) * 0.2
    palm = np.clip(times - 2.0, 0.0, 3.0) * 0.1
    force = np.where((times > 4.0) & (times < 4.5), 3.0, 0.0)
    rows = [
        (t, np.array([a, 0.0, 0.0]), np.array([b, 0.0, 0.0]), np.zeros(3), f)
        for t, a, b, f in zip(times, palm, person, force, strict=True)
    ]
    series = Series(truth=rows, contacts=[(4.15, True, 2.0, "made up")])
    marks = {"offered": 1.5, "motion_started": 2.0, "contact": 4.15, "released": 5.15}
    found = metrics_of(series, 0.0, 8.0, marks)
    assert found["human_idle"] == pytest.approx(1.0 - 2.0 / 8.0, rel=0.01)
    assert found["robot_idle"] == pytest.approx(1.0 - 3.0 / 8.0, rel=0.01)
    assert found["concurrent_activity"] == pytest.approx(1.0 / 8.0, abs=0.01)
    assert found["functional_delay"] == pytest.approx(-1.0 / 8.0, abs=0.01)
    assert found["palm_peak_speed_m_s"] == pytest.approx(0.1, rel=0.01)
    assert found["detection_delay_s"] == pytest.approx(0.14, abs=0.011)
    assert found["peak_force_n"] == 3.0
    assert found["offer_to_contact_s"] == pytest.approx(2.65) and found["contact_to_release_s"] == pytest.approx(1.0)


def test_a_trackers_noise_is_no_motion() -> None:
    random = np.random.default_rng(3)
    rows = [(t, 0.0005 * random.standard_normal(3)) for t in np.arange(0.0, 3.0, 1 / 30)]
    assert speed_on(np.arange(0.0, 2.9, 1.0 / RATE), rows, 1).mean() < 0.05
