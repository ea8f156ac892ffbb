"""The rows of ./coglab bench fri about latency: missing answers are those of every packet, a shortened run is a sample,
the node is the one that is launched by default, and rows "with feedback controllers" are missed where none has run."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_fri

LAUNCH = Path(bench_fri.__file__).with_name("fri.launch")
BLOCKS = [(kind, [50.0] * 500) for kind in ("echo", "bridge", "bridge", "echo")]
EVERY = {"bridge": [2000, 0, 0, 0], "echo": [2000, 0, 0, 0]}
SHIPPED = ["ee_admittance", "joint_limits"]


def missing_row(counts: dict[str, list[int]]) -> dict[str, object]:
    """The row about answers that did not come."""
    (row,) = [row for row in bench_fri.figures("here", BLOCKS, counts) if row["unit"] == "packets"]
    return row


@pytest.mark.parametrize("before", [0, 1], ids=["beside a block of the echo", "before the motion"])
def test_an_answer_that_is_missing_outside_the_bridges_own_blocks_makes_its_row_missed(before):
    fine = missing_row(EVERY)
    assert fine["ok"] and fine["value"] == 0 and "all 2000 packets" in fine["figure"]
    row = missing_row({"bridge": [2500, 1, 1, before], "echo": [2500, 3, 0, 0]})
    assert not row["ok"] and (row["value"], row["peer_value"]) == (1, 3)
    assert f"({before} of them before the blocks; 1 came late)" in row["figure"]


def test_every_row_of_a_shortened_run_is_a_sample(monkeypatch):
    monkeypatch.setattr(bench_fri, "QUADS", 2)
    rows = [*bench_fri.figures("here", BLOCKS, EVERY), bench_fri.share_row("here", 0.9)]
    assert {(row["done"], row["asked"]) for row in rows} == {(2, 40)}


def test_the_node_is_the_one_of_the_default_launch_but_for_its_port():
    root = ElementTree.parse(LAUNCH).getroot()
    assert [element.tag for element in root] == ["include"]
    assert [argument.attrib for argument in root.iter("arg")] == [{"name": "fri_port", "value": "0"}]


def moving_rows(monkeypatch, looks: list[list[str]], loaded: list[str] = SHIPPED, rounds: int = 40) -> list[dict]:
    """The rows of a fine run with a motion, in which these feedback controllers ran at each look."""
    monkeypatch.setattr(bench_fri, "QUADS", rounds)
    return bench_fri.moving_rows(", beside", BLOCKS, 0.99, EVERY, loaded, looks)


def judged(rows: list[dict]) -> dict[str, bool]:
    """Verdict by figure, of those with a goal."""
    return {row["figure"]: row["ok"] for row in rows if row["goal"] != "reported"}


def test_the_rows_of_a_motion_say_how_many_feedback_controllers_ran(monkeypatch):
    rows = moving_rows(monkeypatch, [SHIPPED] * 50)
    assert len(judged(rows)) == 5 and all(judged(rows).values())
    assert all("while a motion runs, with 2 feedback controllers, beside" in row["figure"] for row in rows)
    (row,) = [row for row in rows if row["figure"].startswith("feedback controllers that ran")]
    assert (row["value"], row["goal"]) == (2, ">= 2")
    assert "at each of 50 looks, of 2 loaded (ee_admittance, joint_limits)" in row["figure"]


@pytest.mark.parametrize(
    "looks",
    [[], [[]] * 50, [SHIPPED] * 49 + [[]], [["ee_admittance"]] * 25 + [["joint_limits"]] * 25, [SHIPPED] * 39],
    ids=["never looked at", "none ran", "none at one look", "each only for a while", "fewer looks than rounds"],
)
def test_without_a_feedback_controller_that_runs_every_row_of_a_motion_is_missed(monkeypatch, looks):
    rows = moving_rows(monkeypatch, looks)
    assert len(judged(rows)) == 5 and not any(judged(rows).values())
    assert all("with 0 feedback controllers" in row["figure"] for row in rows)


def test_one_of_two_feedback_controllers_misses_the_row_of_their_number_alone(monkeypatch):
    rows = moving_rows(monkeypatch, [SHIPPED] * 49 + [["joint_limits"]])
    assert all("with 1 feedback controller, beside" in row["figure"] for row in rows)
    missed = [figure for figure, ok in judged(rows).items() if not ok]
    assert len(missed) == 1 and missed[0].startswith("feedback controllers that ran")


def test_where_no_feedback_controller_is_loaded_their_number_is_missed_too(monkeypatch):
    assert not any(judged(moving_rows(monkeypatch, [[]] * 50, [])).values())


def look_at(activity: str, *cycles: int) -> list[list[str]]:
    """What is seen of a controller that says that it is this active, in these cycles."""
    feedback = bench_fri.Feedback()
    feedback.take_status(SimpleNamespace(controllers=[SimpleNamespace(name="joint_limits", activity=activity)]))
    for cycle in cycles:
        feedback.take_state(SimpleNamespace(cycle=cycle, states=[SimpleNamespace(controller="joint_limits")]))
    return feedback.looks


def test_a_feedback_controller_ran_if_it_is_running_and_was_updated_in_the_cycle_looked_at():
    assert look_at("running", 40, 80) == [["joint_limits"], ["joint_limits"]]
    assert look_at("running", 40, 40) == [["joint_limits"], []], "no cycle since the last look"
    assert look_at("stopping", 40) == look_at("waiting", 40) == [[]], "its last correction is held or fades"
    feedback = bench_fri.Feedback()
    feedback.take_status(SimpleNamespace(controllers=[SimpleNamespace(name="joint_limits", activity="running")]))
    feedback.take_state(SimpleNamespace(cycle=40, states=[]))
    assert feedback.looks == [[]] and list(feedback.activity) == ["joint_limits"]


def test_only_what_is_seen_from_the_first_block_on_counts(tmp_path):
    feedback = bench_fri.Feedback()
    feedback.looks = [[]]
    peer, seen = tmp_path / "peer", tmp_path / "seen"
    peer.write_text(f"#!/bin/sh\necho ready\nwhile [ ! -e {seen} ]; do sleep 0.01; done\necho moving 0.5\n")
    peer.chmod(0o755)

    def look() -> None:
        feedback.looks.append(SHIPPED)
        seen.touch()

    threading.Timer(1.0, look).start()  # long after the first word
    assert bench_fri.follow([str(peer)], feedback) == (0, "ready\nmoving 0.5\n", [SHIPPED])
