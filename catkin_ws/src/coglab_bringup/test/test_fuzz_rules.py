"""What the judge of the random messages takes for malformed is what the srv files exclude."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest
import roslib.message
from coglab_bringup.fuzz_rules import DOCUMENTED, ODD, excluded, unprintable
from coglab_bringup.ros_fuzz import ALLOWED, MALFORMED, Generator
from coglab_msgs.srv import CancelMotionRequest, FeedbackSelectRequest, LocateObjectRequest

SERVICES = Path(__file__).resolve().parents[2] / "coglab_msgs" / "srv"


@pytest.mark.parametrize("of, name", DOCUMENTED)
def test_what_may_come_stands_in_the_srv_file_at_the_field(of, name):
    request = of.partition("/")[2]
    text = (SERVICES / f"{request.removesuffix('Request')}.srv").read_text(encoding="utf-8").partition("---")[0]
    # Its line, and the lines of comment alone that follow.
    (field,) = re.findall(rf"^\w+ {name} .*(?:\n +#.*)*", text, re.MULTILINE)
    assert DOCUMENTED[of, name].words in field, field
    assert name in roslib.message.get_service_class(of.removesuffix("Request"))._request_class.__slots__


def test_a_reason_is_judged_by_what_can_be_shown():
    wrong = {" ", "\0", "a\0b", "\N{RIGHT-TO-LEFT OVERRIDE}x", "\x1b[2J", "x" * 65536}
    assert {text for text in ODD if unprintable(text)} == wrong
    assert not any(map(unprintable, ("", "user", "two words", "x" * 200))) and unprintable("☃" * 67)


@pytest.mark.parametrize(
    "request_, name, of, expected",
    [
        (FeedbackSelectRequest(reason="nan"), "reason", "string", False),
        (FeedbackSelectRequest(reason="\x1b[2J"), "reason", "string", True),
        (CancelMotionRequest(time_limit=float("nan"), reason="\0"), "time_limit", "float64", False),
        (LocateObjectRequest(object_id="nan"), "object_id", "string", True),
        ([0.0, float("-inf")], 1, "float32", True),
        ([0.0, 1e9], 1, "float64", False),
        (["", "//x"], 1, "string", True),
        (["", "mug"], 1, "string", False),
    ],
)
def test_a_field_that_no_srv_file_speaks_of_excludes_every_odd_value(request_, name, of, expected):
    assert excluded(request_, name, of) is expected


def test_a_message_is_malformed_by_any_one_of_its_fields():
    generator, found = Generator(7), Counter()
    for _ in range(2000):
        message, what = generator.message(FeedbackSelectRequest)
        found[what] += 1
        assert (what == MALFORMED) == (unprintable(message.reason) or any(name in ODD for name in message.names))
    assert set(found) == {MALFORMED, ALLOWED} and found[MALFORMED] > 5 * found[ALLOWED], found
    assert {generator.message(CancelMotionRequest)[1] for _ in range(100)} == {ALLOWED}
