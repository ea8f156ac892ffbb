"""The three robots of the Python examples succeed with feedback and fail without it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples" / "python"))

import biped
import fixed_arm
import wheeled_base


def test_arm_yields_at_the_wall_and_keeps_its_elbow_in_range() -> None:
    stiff, soft = fixed_arm.run([]), fixed_arm.run(["admittance", "limits"])
    assert stiff["force"].max() > 130.0 and soft["force"].max() < 25.0
    assert stiff["elbow"].max() > fixed_arm.ELBOW_END
    assert soft["elbow"].max() < fixed_arm.ELBOW_END - 0.025  # JointLimits keeps 0.03 rad
    free = stiff["t"] < 0.8  # before the wall nothing is corrected
    assert np.array_equal(stiff["x"][free], soft["x"][free])


def test_biped_stands_a_push_by_its_dcm_and_falls_without() -> None:
    assert biped.run(*biped.CASES["short push, no feedback"])["fallen"][-1]
    one = biped.run(*biped.CASES["short push, dcm"])
    assert not one["fallen"].any() and abs(one["com"][-1]) < 1e-3


def test_biped_leans_against_a_long_push_or_yields_to_it() -> None:
    end = round(biped.LONG[1] / biped.DT) - 2
    stiff, lean, soft = (biped.run(*biped.CASES[f"long push, {name}"]) for name in ("no feedback", "lean", "yield"))
    shift = 20.0 * 0.8 / (40.0 * 9.80665)  # m, by which the push moves the ZMP off the centre of mass
    assert lean["com"][end] == pytest.approx(-shift, abs=0.003) and abs(lean["zmp"][end]) < 0.003
    assert soft["com"][end] - stiff["com"][end] == pytest.approx(20.0 / 1000.0, abs=0.003)  # N by N/m
    for one in (stiff, lean, soft):
        assert not one["fallen"].any() and abs(one["com"][-1]) < 0.004


def test_base_follows_its_circle_though_a_wheel_slips() -> None:
    lost, kept = (np.hypot(*(one[:, 3:] - one[:, 1:3]).T) for one in (wheeled_base.run(False), wheeled_base.run(True)))
    assert lost[-1] > 3.0 and kept[-1] < 0.05


@pytest.mark.parametrize("example", [fixed_arm, biped, wheeled_base], ids=lambda example: str(example.__name__))
def test_example_says_what_happened_and_draws_it(
    example: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "picture.png"
    monkeypatch.setattr(sys, "argv", ["example", "--plot", str(picture)])
    example.main()  # type: ignore[attr-defined]
    assert "without feedback" in (said := capsys.readouterr().out) or "no feedback" in said
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and picture.stat().st_size > 5000
