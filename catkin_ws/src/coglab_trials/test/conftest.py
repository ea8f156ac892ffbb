"""Fixtures of the trials' tests."""

import pytest
import smach


@pytest.fixture(autouse=True)
def quiet():
    """The engine logs each transition; hundreds of lines help nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)
