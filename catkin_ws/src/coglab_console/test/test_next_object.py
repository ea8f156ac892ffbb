"""The request names the object of the next action: the chosen one, or that of the session's trial."""

import time
from dataclasses import replace

import pytest
from desk_double import ask, desk_in, shown

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
OBJECTS = ("ball", "mug", "tea_box")


@pytest.fixture
def cell(desk):
    """A desk whose database has objects."""
    stands(desk)
    return desk


def stands(desk, held=""):
    """The hub with this object in the hand."""
    actions = (GIVE, "put") if held else (RECEIVE, "take")
    desk.backend.now = replace(desk.backend.now, object_id=held, actions=actions, objects=OBJECTS)
    desk.tick()


def asked(desk, action, **more):
    """The request to the machine."""
    answer = ask(desk, "a", "start", action=action, **more)
    assert answer["success"], answer
    return desk.backend.calls[-1][1]


def test_object_chosen_while_holding_another_is_requested_next(cell):
    stands(cell, "mug")
    assert ask(cell, "a", "select_object", object_id="ball")["success"]
    stands(cell, "mug")
    assert shown(cell)["object"] == "ball"
    assert asked(cell, GIVE)["object_id"] == "mug"
    stands(cell)
    assert asked(cell, RECEIVE)["object_id"] == "ball"


def test_given_object_is_not_requested_again(cell):
    stands(cell, "tea_box")
    stands(cell)
    assert asked(cell, RECEIVE)["object_id"] == ""


def test_choice_names_an_unknown_object_in_the_hand(cell):
    """After a restart the held object is unknown; the request names it."""
    stands(cell, "unknown")
    ask(cell, "a", "select_object", object_id="ball")
    assert asked(cell, GIVE)["object_id"] == "ball"


def test_object_named_in_the_request_has_priority(cell):
    ask(cell, "a", "select_object", object_id="ball")
    assert asked(cell, RECEIVE, object_id="mug")["object_id"] == "mug"


def begin(desk, conditions):
    """A session and its first trial."""
    assert ask(desk, "a", "session_begin", participant="P1", conditions=conditions, repetitions=1, order="as_listed")[
        "success"
    ]
    return ask(desk, "a", "trial_begin")


def test_the_trial_of_the_order_names_the_object_of_its_requests(cell):
    answer = begin(cell, ["Receive Ball", "receive tea_box"])
    assert answer["success"] and "ball" in answer["message"]
    assert asked(cell, RECEIVE)["object_id"] == "ball" and ("select_object", "ball") in cell.backend.published
    ask(cell, "a", "trial_end", outcome="skipped")
    assert ask(cell, "a", "trial_begin")["success"]
    assert asked(cell, RECEIVE)["object_id"] == "tea_box"
    events = [event["text"] for event in cell.events.since(0)[0] if event["source"] == "object"]
    assert len(events) == 2 and "tea_box" in events[1] and "trial 2" in events[1]


def test_choice_of_the_object_wins_over_the_condition(cell):
    begin(cell, ["receive ball", "receive slowly"])
    ask(cell, "a", "select_object", object_id="mug")
    stands(cell)
    assert asked(cell, RECEIVE)["object_id"] == "mug"
    ask(cell, "a", "trial_end", outcome="skipped")
    ask(cell, "a", "trial_begin")
    assert asked(cell, RECEIVE)["object_id"] == "mug"


def test_object_of_the_trial_survives_a_killed_console(tmp_path):
    before = desk_in(tmp_path)
    before.connected("a")
    stands(before)
    begin(before, ["receive ball"])
    after = desk_in(tmp_path, lambda: time.time() + 1.0)
    after.connected("a")
    assert shown(after)["object"] == ""
    # The database is read a moment later.
    stands(after)
    assert asked(after, RECEIVE)["object_id"] == "ball"
