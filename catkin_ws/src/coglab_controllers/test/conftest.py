"""Common fixtures for the tests of the cores."""

from __future__ import annotations

from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

DESCRIPTION = Path(__file__).resolve().parents[2] / "lwr_description"


@pytest.fixture(scope="session")
def chain() -> cc.Chain:
    """The arm with the palm as its tool."""
    return cc.Chain((DESCRIPTION / "urdf" / "lwr_ih2.urdf").read_text())


@pytest.fixture(scope="session")
def limits() -> cc.JointLimits:
    return cc.load_joint_limits(str(DESCRIPTION / "config" / "joint_limits.yaml"))


@pytest.fixture(scope="session")
def reach() -> cc.Primitive:
    """A reach of 0.51 m in 1.2 s, learnt from a minimum-jerk motion."""
    times = np.linspace(0.0, 1.2, 241)
    u = times / 1.2
    path = np.outer(u**3 * (10.0 - 15.0 * u + 6.0 * u**2), [0.5, 0.0, 0.1])
    return cc.learn("reach", [(times, path)], mapping="similarity")
