"""The rows of ./coglab bench fuzz: what fell silent is counted, whether its node says why or not, and what got no
message is named."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest
from coglab_bringup.bench import COLUMNS
from coglab_bringup.ros_fuzz import explained

PACKAGE = Path(__file__).resolve().parents[1]
GOAL, STATE = "/controller_manager/dmp/dmp_goal", "/lwr/state"
WORDS = "no goal: frame 'human_hand' is not known in 'lwr_base_link'"
FOUND = {
    "nodes": 15, "topics": 64, "services": 75, "spoke": 40, "silent": [], "explained": {},
    "left_out": ["/coglab/stop"], "spared": ["/dmp/cancel"],
    "sent": {"malformed": 100, "valid by nature": 20}, "answers": {"refused": 90, "error": 9}, "lost": ["/one"],
    "unanswered": 0, "late": {}, "accepted": {}, "ended": [], "moved": 0.001, "motion_allowed": True,
    "motion_refused": [], "computer_late": 2, "thrown": [],
    "reach": {"states": ["running", "reached"], "code": 0, "distance": 0.001, "speed": 0.4},
}  # fmt: skip


@pytest.fixture
def bench_fuzz():
    """The bench as a module."""
    spec = importlib.util.spec_from_file_location("bench_fuzz", PACKAGE / "bench" / "bench_fuzz.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def silence(module, **found) -> tuple[dict, dict]:
    """The rows of what fell silent without a word, and with one."""
    rows = module.rows_of("split", FOUND | found)
    (without,) = [row for row in rows if "fell silent without" in row["figure"]]
    (told,) = [row for row in rows if "fell silent for a reason" in row["figure"]]
    return without, told


def test_what_fell_silent_is_counted_with_the_reason_and_without(bench_fuzz):
    without, told = silence(bench_fuzz)
    assert (without["value"], without["ok"], told["value"], told["goal"]) == (0, True, 0, "reported")
    assert all("of 40 " in row["figure"] and row["figure"].endswith(": none") for row in (without, told))
    without, told = silence(bench_fuzz, explained={GOAL: WORDS})
    assert (without["value"], without["ok"], told["value"]) == (0, True, 1)
    assert GOAL in told["figure"] and WORDS in told["figure"] and without["figure"].endswith(": none")
    without, told = silence(bench_fuzz, silent=[GOAL], explained={STATE: "why"})
    assert (without["value"], without["ok"], told["value"]) == (1, False, 1)
    assert without["figure"].endswith(f": {GOAL}")


def test_what_got_no_message_is_named_and_counted(bench_fuzz):
    (row,) = [row for row in bench_fuzz.rows_of("split", FOUND) if "no message" in row["figure"]]
    assert "/coglab/stop" in row["figure"] and "/dmp/cancel" in row["figure"]
    assert (row["value"], row["goal"]) == (2, "reported")


def test_each_row_says_of_how_many_and_how_it_was_started(bench_fuzz):
    names = {way: [row["figure"] for row in bench_fuzz.rows_of(way, FOUND)] for way in bench_fuzz.WAYS}
    assert len({name for rows in names.values() for name in rows}) == sum(map(len, names.values()))
    text = "\n".join(names["split"])
    assert "two processes" in text and "of 15 nodes" in text and "of 100 requests" in text
    for row in bench_fuzz.rows_of("one", FOUND):
        assert set(row) == set(COLUMNS) and json.dumps(row)


def test_a_reason_counts_while_the_node_still_gives_it():
    said = {GOAL: (100.0, WORDS), STATE: (90.0, "why")}
    assert explained({GOAL}, said, now=107.0, within=8.0) == {GOAL: WORDS}
    assert explained({GOAL, STATE}, said, now=108.1, within=8.0) == {}
    assert explained({STATE, "/other"}, said, now=95.0, within=8.0) == {STATE: "why"}
    assert explained(set(), said, now=100.0, within=8.0) == {}, "nothing is silent"


def test_who_may_be_silent_is_a_node_whose_source_says_those_words():
    sys.path.insert(0, str(PACKAGE / "test"))
    try:
        from fuzz_rostest import HEARD_AFTER, SAID_WITHIN, TOLD_BY_TF
    finally:
        sys.path.remove(str(PACKAGE / "test"))
    assert set(TOLD_BY_TF) == {GOAL} and SAID_WITHIN >= HEARD_AFTER + 5.0, "each of its words comes every 5 s"
    node, words = TOLD_BY_TF[GOAL]
    launch = (PACKAGE.parent / "coglab_controllers" / "launch" / "goal_helper.launch").read_text(encoding="utf-8")
    source = (PACKAGE.parent / "coglab_controllers" / "src" / "ros" / "goal_helper_node.cpp").read_text(
        encoding="utf-8"
    )
    assert f'name="{node.strip("/")}"' in launch and source.count("ROS_WARN_THROTTLE(5.0") == source.count(f'"{words}')
