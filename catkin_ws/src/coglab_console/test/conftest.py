"""Fixtures of the console's tests."""

import pytest
from desk_double import desk_in
from page_double import Desk


@pytest.fixture
def desk(tmp_path):
    """A desk with browser a, the operator, and browser b."""
    made = desk_in(tmp_path)
    made.connected("a")
    made.connected("b")
    return made


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """The page in a real browser, with a double in place of the robot."""
    found = Desk(tmp_path_factory.mktemp("console"))
    yield found
    found.close()
