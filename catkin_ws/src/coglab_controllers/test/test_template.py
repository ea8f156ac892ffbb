"""The template of a motion of one's own says what its code does, and its code what the page of the template says."""

from __future__ import annotations

import re
from pathlib import Path

TEMPLATE = Path(__file__).resolve().parent.parent / "template"
CODE = (TEMPLATE / "src" / "@name@.cpp.in").read_text(encoding="utf-8")
PAGE = (TEMPLATE / "README.md.in").read_text(encoding="utf-8")
TEST = (TEMPLATE / "test" / "test_motion.cpp.in").read_text(encoding="utf-8")


def arguments() -> dict[str, tuple[str, float, float, float]]:
    """Unit, default, least and largest value of each argument, by the code."""
    found = re.findall(r'configuration\.argument\("(\w+)", "([^"]+)", ([\d.]+), ([\d.]+), ([\d.]+)\)', CODE)
    return {name: (unit, float(usual), float(least), float(most)) for name, unit, usual, least, most in found}


def test_arguments_have_the_units_defaults_and_ranges_of_the_page() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (\S+) \| ([\d.]+) \| ([\d.]+) to ([\d.]+) \|", PAGE, re.MULTILINE)
    told = {name: (unit, float(usual), float(least), float(most)) for name, unit, usual, least, most in rows}
    assert len(told) == 2 and arguments() == told


def test_the_test_of_the_template_asks_for_what_is_in_range_and_for_what_is_not() -> None:
    _, _, least, most = arguments()["amplitude"]
    fine = re.search(r'\{"amplitude", "duration"\}, \{([\d.]+), ([\d.]+)\}', TEST)
    bad = re.search(r'\{"amplitude"\}, \{([\d.]+)\}', TEST)
    assert fine is not None and bad is not None
    assert least < float(fine[1]) < most < float(bad[1])
    _, _, least, most = arguments()["duration"]
    assert least <= float(fine[2]) <= most
