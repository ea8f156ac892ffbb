"""What the pages say of the repository: tests that they name and files that the recipes of CONTRIBUTING.md lead to."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
GTEST = re.compile(r"^TEST(?:_[FP])?\(\s*(\w+),\s*(\w+)\)", re.MULTILINE)
# Written like the name of a gtest: files, fields of messages, methods of Python classes.
NO_GTEST = re.compile(r"\.(md|src|dat|txt|test|apply_profile|supervisor|add)$")


def pages() -> list[Path]:
    return [*TOP.glob("*.md"), *TOP.glob("docs/*.md"), *SOURCES.rglob("*.md")]


def known_tests() -> set[str]:
    """Files, functions and gtests, each by the names that a page may use."""
    names: set[str] = set()
    for path in SOURCES.rglob("*"):
        if path.suffix in (".py", ".cpp", ".test"):
            names |= {path.stem, path.stem.removesuffix("_rostest")}
            text = path.read_text(encoding="utf-8")
            names |= set(re.findall(r"def (test_\w+)", text))
            names |= {name for suite, case in GTEST.findall(text) for name in (f"{suite}.{case}", f"{suite}.*")}
    return names


def test_every_test_that_a_page_names_is_there():
    known, wrong = known_tests(), []
    assert {"Cycle.TheCounterCounts", "Cycle.*", "test_house", "test_no_file_is_too_long"} <= known
    for path in pages():
        text = path.read_text(encoding="utf-8")
        named = re.findall(r"(?<![\w/])test_\w*[a-z](?!\w|\*|_\*)", text)
        named += [n for n in re.findall(r"`(?:[\w.]+: )?([A-Z]\w+\.(?:\w+|\*))`", text) if not NO_GTEST.search(n)]
        wrong += [f"{path.relative_to(TOP)}: {name}" for name in named if name not in known]
        for prefix in re.findall(r"(?<![\w/])(test_\w+)_\*", text):
            if not any(name.startswith(prefix) for name in known):
                wrong.append(f"{path.relative_to(TOP)}: {prefix}_*")
    assert not wrong, "no such test:\n" + "\n".join(wrong)


def test_every_service_without_a_code_is_on_the_page_of_the_house():
    page = (TOP / "docs" / "house.md").read_text(encoding="utf-8").split("## Codes beside sentences")[1].split("## ")[0]
    nodes = [p for p in SOURCES.rglob("*.py") if {"scripts", "ros"} & set(p.parts) and "test" not in p.parts]
    served = r"rospy\.Service\(\"[~\w/]*?(\w+)\", (Trigger|SetBool|Empty)\b"
    found = {pair for path in nodes for pair in re.findall(served, path.read_text(encoding="utf-8"))}
    assert ("why", "Trigger") in found and ("stop", "Trigger") in found
    missing = [name for name, kind in found if not re.search(rf"^\| `/\w+/{name}` \| std_srvs/{kind} ", page, re.M)]
    assert not missing, missing


def test_every_mark_of_an_action_is_in_the_reference():
    """And none that nothing makes."""
    page = (TOP / "docs" / "reference.md").read_text(encoding="utf-8")
    table = page.split("Marks in `/coglab/results`")[1].split("\n## ")[0]
    told = {name for row in re.findall(r"^\| (`.*?) \|", table, re.M) for name in re.findall(r"`(\w+)`", row)}
    states = (SOURCES / "coglab_smach" / "src").rglob("*.py")
    made = {name for p in states for name in re.findall(r"journal\.mark\(\"(\w+)\"\)", p.read_text(encoding="utf-8"))}
    assert len(made) > 15 and told == made


def test_the_table_of_the_house_is_what_its_command_prints():
    page = (TOP / "docs" / "house.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"`(docs/count_lines [\w ]+)` prints", page)
    tools = f"{TOP}/.coglab/venv/bin:{os.environ.get('PATH', os.defpath)}"
    missing = [tool for tool in ("cloc", "clang-format", "ruff") if shutil.which(tool, path=tools) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    for commit in command.split()[1:]:
        known = subprocess.run(["git", "-C", str(TOP), "cat-file", "-e", commit], capture_output=True, timeout=30)
        if known.returncode != 0:
            pytest.skip(f"commit {commit} is not in this checkout")
    done = subprocess.run(command.split(), cwd=TOP, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout in page, done.stdout


def test_the_recipes_lead_to_what_is_there():
    table = (TOP / "CONTRIBUTING.md").read_text(encoding="utf-8").split("## Build")[0]
    rows = re.findall(r"^\| an? [^|]+\|[^|]+\|[^|]*\|$", table, flags=re.MULTILINE)
    assert len(rows) >= 15, rows
    places = {p for row in rows for p in re.findall(r"`([\w./]+/[\w.]*|\w+\.(?:py|hpp|cpp))`", row)}
    assert {"coglab_smach/src/coglab_smach/states/", "coglab_sim/nodes/cell_faults.cpp"} <= places
    written = {"NAME", "PACKAGE", "THING", "DIR"}  # placeholders: the file is the reader's own
    missing = []
    for place in sorted(places):
        if any(word in place for word in written):
            continue
        roots = (SOURCES / place, TOP / place, *SOURCES.glob(f"*/include/{place}"))
        if not any(root.exists() for root in roots) and ("/" in place or not any(SOURCES.rglob(place))):
            missing.append(place)
    assert not missing, missing
