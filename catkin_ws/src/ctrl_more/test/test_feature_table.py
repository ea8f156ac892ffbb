"""Every test that doc/features_and_defects.md names exists."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
PAGE = PACKAGE / "doc" / "features_and_defects.md"


def existing_tests() -> set[str]:
    """`Suite.name` of the C++ tests, `file::name` of the Python ones."""
    names: set[str] = set()
    for path in (PACKAGE / "test").glob("test_*.cpp"):
        found = re.findall(r"^TEST(?:_F|_P)?\((\w+), (\w+)\)", path.read_text(), re.MULTILINE)
        names |= {f"{suite}.{name}" for suite, name in found}
    for path in (PACKAGE / "test").glob("test_*.py"):
        found = re.findall(r"^def (test_\w+)\(", path.read_text(), re.MULTILINE)
        names |= {f"{path.name}::{name}" for name in found}
    return names


def test_every_named_test_exists() -> None:
    page = PAGE.read_text()
    named = set(re.findall(r"`([A-Z]\w+\.[A-Z]\w+|test_\w+\.py::test_\w+)`", page))
    assert len(named) > 60
    missing = sorted(named - existing_tests())
    assert not missing, missing


def test_every_row_names_a_test() -> None:
    rows = [line for line in PAGE.read_text().splitlines() if re.match(r"\| ([A-J]\d|\d)", line)]
    assert len(rows) > 90
    bare = [
        row for row in rows if not re.search(r"`([A-Z]\w+\.[A-Z]\w+|test_\w+\.py::\w+)` ?\|?", row.rsplit("|", 2)[1])
    ]
    assert not bare, bare
