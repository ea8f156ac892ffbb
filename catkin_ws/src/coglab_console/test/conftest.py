"""What several of the tests begin with."""

import pytest
from desk_double import desk_in


@pytest.fixture
def desk(tmp_path):
    """A desk with the browsers a, which operates, and b."""
    made = desk_in(tmp_path)
    made.connected("a")
    made.connected("b")
    return made
