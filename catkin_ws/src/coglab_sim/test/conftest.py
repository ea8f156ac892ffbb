"""Fixtures of the cell's tests."""

from pathlib import Path

import pytest
from fri_client import Session

URDF = str(Path(__file__).resolve().parents[2] / "lwr_description" / "urdf" / "lwr_ih2.urdf")


@pytest.fixture
def session():
    """Makes sessions: session(seed=3, krc__period=0.001, ...)."""
    return lambda **parameters: Session(URDF, **parameters)
