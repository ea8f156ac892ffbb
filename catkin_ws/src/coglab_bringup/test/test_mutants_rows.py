"""The rows of ./coglab bench mutants: too few, too many equivalent ones and what was left out cannot flatter."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from coglab_bringup.mutant import EQUIVALENT, Equivalent, Mutant, read_equivalent
from coglab_bringup.mutant_rows import rows_of
from coglab_bringup.usage import Refused

TOP = Path(__file__).resolve().parents[4]
SEEDS = {"one": 7, "two": 7}


def mutant(number, verdict="killed", package="one"):
    file, text = f"catkin_ws/src/{package}/a.py", f"if a < {number}:"
    changed = text.replace("<", "<=")
    return Mutant(package, file, number, "comparison", "<", "<=", text, changed, verdict, "one/test_a", 1.0)


def package(count, survived=0, name="one"):
    return [mutant(i, "survived" if i < survived else "killed", name) for i in range(count)]


def equivalent(number, reason="a is never that large"):
    of = mutant(number)
    return Equivalent(of.file, of.text, of.changed, reason)


def test_a_row_needs_twelve_mutants_in_each_package():
    rows = rows_of({"one": package(11), "two": package(40, name="two")}, SEEDS, [], [])
    assert [(row["value"], row["ok"]) for row in rows[:3]] == [(100.0, False), (100.0, True), (100.0, False)]
    assert all("seed 7" in row["figure"] and ">= 12 each" in row["goal"] for row in rows[:3])
    assert all(row["ok"] for row in rows_of({"one": package(12), "two": package(12, name="two")}, SEEDS, [], []))


def test_each_row_says_its_seed():
    of = {"one": package(12), "two": package(12, name="two")}
    rows = rows_of(of, {"one": 7, "two": 8}, [], [])
    assert "one, seed 7, of" in rows[0]["figure"] and "two, seed 8, of" in rows[1]["figure"]
    assert "all, seeds of the packages' last commits, of" in rows[2]["figure"]
    assert "all, seed 7, of" in rows_of(of, SEEDS, [], [])[2]["figure"]


def test_rows_say_when_the_tests_of_the_package_alone_have_judged():
    words = ", by the package's own tests alone, "
    of = {"one": package(12), "two": package(12, name="two")}
    assert all(words in row["figure"] for row in rows_of(of, SEEDS, [], [], own=True)[:3])
    assert not any(words in row["figure"] for row in rows_of(of, SEEDS, [], []))


def test_nothing_judged_is_missed():
    rows = rows_of({"one": [None, None]}, SEEDS, [], [])
    assert rows[0]["value"] is None and not rows[0]["ok"]


def test_the_goals_are_shares_of_what_was_judged():
    assert rows_of({"one": package(20, 5)}, SEEDS, [], [])[0]["ok"]
    assert not rows_of({"one": package(20, 6)}, SEEDS, [], [])[0]["ok"]
    both = {"one": package(20, 4), "two": package(20, 3, "two")}
    assert [row["ok"] for row in rows_of(both, SEEDS, [], [])[:3]] == [True, True, False], "82.5 of 85 % over all"


def test_one_in_twenty_of_all_may_be_named_equivalent_and_is_shown():
    of = {"one": package(20, 2), "two": package(20, name="two")}
    rows = rows_of(of, SEEDS, [equivalent(1)], [])
    assert rows[2]["value"] == round(100 * 38 / 39, 1) and "of 40, 1 equivalent left out" in rows[2]["figure"]
    assert (rows[3]["value"], rows[3]["goal"], rows[3]["ok"]) == (1, "<= 2", True)
    assert "a is never that large" in rows[3]["figure"] and "a.py:1: comparison: '<' -> '<='" in rows[3]["figure"]


def test_the_row_of_a_package_subtracts_nothing_and_names_its_equivalent_survivors():
    """One in twenty of twelve is none: a package's own goal is met without any."""
    of = {"one": package(12, 4), "two": package(40, name="two")}
    rows = rows_of(of, SEEDS, [equivalent(1), equivalent(2)], [])
    assert rows[0]["value"] == round(100 * 8 / 12, 1) and not rows[0]["ok"], "66.7 %, not 80 % of ten"
    assert "left out" not in rows[0]["figure"] and "2 named equivalent counted as survivors (" in rows[0]["figure"]
    for number in (1, 2):
        assert f"catkin_ws/src/one/a.py:{number}: comparison: '<' -> '<='" in rows[0]["figure"]
    assert "equivalent" not in rows[1]["figure"]
    assert rows[2]["value"] == round(100 * 48 / 50, 1) and "of 52, 2 equivalent left out" in rows[2]["figure"]


def test_alone_a_package_of_any_size_subtracts_nothing_either():
    (first, named, _) = rows_of({"one": package(40, 10)}, SEEDS, [equivalent(1)], [])
    assert (first["value"], first["ok"]) == (75.0, True) and "1 named equivalent counted as survivors" in first[
        "figure"
    ]
    assert (named["value"], named["goal"], named["ok"]) == (1, "<= 2", True)
    (first, named, _) = rows_of({"one": package(40, 11)}, SEEDS, [equivalent(1), equivalent(2)], [])
    assert (first["value"], first["ok"]) == (72.5, False), "not 29 of 38, which would do"
    assert named["ok"], "so few may be named"


def test_where_more_are_named_none_is_subtracted():
    for count, names in ((20, (0, 1, 2)), (9, (1,))):
        of = {"one": package(count, 3), "two": package(count, name="two")}
        rows = rows_of(of, SEEDS, [equivalent(n) for n in names], [])
        assert rows[2]["value"] == round(100 * (2 * count - 3) / (2 * count), 1)
        assert "left out" not in rows[2]["figure"] and "too many, so that none is left out" in rows[3]["figure"]
        assert not rows[3]["ok"] and rows[3]["value"] == len(names)


def test_what_a_test_notices_is_not_equivalent_and_an_entry_names_one():
    assert rows_of({"one": package(20)}, SEEDS, [equivalent(1)], [])[1]["value"] == 0
    twice = [mutant(1, "survived"), mutant(1, "survived"), *package(40)]
    assert rows_of({"one": twice}, SEEDS, [equivalent(1)], [])[1]["value"] == 1
    other = Equivalent(mutant(1).file, mutant(1).text, "if a == 1:", "another change of that line")
    assert rows_of({"one": package(20, 2)}, SEEDS, [other], [])[1]["value"] == 0


def test_what_was_left_out_is_counted():
    row = rows_of({"one": [None, *package(12), None]}, SEEDS, [], ["p/test_b", "p/test_a"])[-1]
    assert "2 changes that did not compile" in row["figure"] and "2 test programs" in row["figure"]
    assert "p/test_a, p/test_b" in row["figure"] and (row["value"], row["goal"]) == (4, "reported")


def test_the_kept_list_has_a_reason_for_each(tmp_path):
    read_equivalent(TOP)
    (tmp_path / "docs").mkdir()
    entry = {"file": "a", "line": "b", "change": "c", "reason": "d"}
    for content in ("{", "[1]", json.dumps([entry | {"reason": " "}]), json.dumps([{"file": "a"}])):
        (tmp_path / EQUIVALENT).write_text(content)
        with pytest.raises(Refused, match="expected"):
            read_equivalent(tmp_path)
    (tmp_path / EQUIVALENT).write_text(json.dumps([entry]))
    assert read_equivalent(tmp_path) == [Equivalent("a", "b", "c", "d")]
