"""Sequence."""

import smach
from machine_parts import Says


def sequence(*items, outcomes=("done", "failed")):
    result = smach.Sequence(outcomes=outcomes, connector_outcome="done")
    with result:
        for label, state, transitions in items:
            smach.Sequence.add(label, state, transitions=transitions)
    return result


def test_connects_in_order_and_the_last_falls_through():
    seq = sequence(("A", Says("done"), None), ("B", Says("done"), None), ("C", Says("done"), None))
    assert seq.get_internal_edges() == [("done", "A", "B"), ("done", "B", "C"), ("done", "C", None)]
    assert seq.execute() == "done" and [seq[k].runs for k in "ABC"] == [1, 1, 1]


def test_an_explicit_target_stays_and_none_does_not():
    seq = sequence(
        ("A", Says("done"), {"done": "C"}),
        ("B", Says("done"), {"done": None}),
        ("C", Says("done"), None),
    )
    assert ("done", "A", "C") in seq.get_internal_edges() and (
        "done",
        "B",
        "C",
    ) in seq.get_internal_edges()
    assert seq.execute() == "done" and seq["B"].runs == 0


def test_other_outcomes_leave_the_sequence():
    seq = sequence(("A", Says("failed", registered=["done", "failed"]), None), ("B", Says("done"), None))
    assert seq.execute() == "failed" and seq["B"].runs == 0


def test_a_state_without_the_connector_is_logged_only(log):
    seq = sequence(("A", Says("other"), {"other": "B"}), ("B", Says("done"), None))
    assert "connector" in log.text("error") and seq.execute() == "done"
