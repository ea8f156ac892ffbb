"""Which values the definition of a field excludes: the rule by which the judge of the random messages (ros_fuzz.py)
calls a request malformed.

A float that is not finite or near 1e308, and an odd string, are excluded, but in the fields of DOCUMENTED: there the
srv file says what may come, and that alone decides.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

EXCLUDED = (math.nan, math.inf, -math.inf, 1e308, -1e308)
ODD = (
    " ",
    "\0",
    "a\0b",
    "../../../../etc/passwd",
    "/dev/zero",
    "%s%n%x",
    "☃" * 50,
    "{[}:",
    "/",
    "//x",
    "~x",
    "-1",
    "nan",
    "\N{RIGHT-TO-LEFT OVERRIDE}x",
    "\x1b[2J",
    "x" * 65536,
)
DIRECTION = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
"""marks of writing direction"""


def nothing(_value: Any) -> bool:
    """Excluded where the srv file takes anything."""
    return False


def unprintable(text: str) -> bool:
    """Excluded where the srv file takes any printable text of at most 200 bytes."""
    # Categories of Unicode: control, separators of lines and paragraphs.
    steering = any(c in DIRECTION or unicodedata.category(c) in ("Cc", "Zl", "Zp") for c in text)
    return steering or len(text.encode()) > 200 or (text != "" and not text.strip())


@dataclass(frozen=True)
class Rule:
    """What a field excludes, and the words of its srv file that say so."""

    excludes: Callable[[Any], bool]
    words: str


DOCUMENTED = {
    ("coglab_msgs/FeedbackSelectRequest", "reason"): Rule(
        unprintable, "Any printable text in UTF-8 of at most 200 bytes"
    ),
    ("coglab_msgs/CancelMotionRequest", "time_limit"): Rule(nothing, "any number: 2 s for 0, less, and NaN"),
    ("coglab_msgs/CancelMotionRequest", "reason"): Rule(nothing, "for the log: any text"),
    ("coglab_msgs/InitVisionRequest", "timeout"): Rule(nothing, "any number: none for 0, less, and NaN"),
    ("coglab_msgs/LocateObjectRequest", "timeout"): Rule(nothing, "any number: none for 0, less, and NaN"),
    ("coglab_msgs/FreePlacesRequest", "timeout"): Rule(nothing, "any number: none for 0, less, and NaN"),
    ("coglab_msgs/FreePlacesRequest", "object_id"): Rule(nothing, "to be put; any text"),
}
"""by type of the request and field; every other field excludes what EXCLUDED and ODD hold"""


def excluded(holder: Any, name: Any, of: str) -> bool:
    """Whether the definition of a field (of a message, or of a list that is one) excludes the value that it has."""
    value = holder[name] if isinstance(holder, list) else getattr(holder, name)
    rule = DOCUMENTED.get((getattr(holder, "_type", ""), name))
    if rule is not None:
        return rule.excludes(value)
    if of in ("float32", "float64"):
        return not abs(value) < 1e308
    return of == "string" and value in ODD
