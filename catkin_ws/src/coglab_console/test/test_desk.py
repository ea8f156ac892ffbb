"""Roles, reasons of refusals, the list of commands, sessions; with a double of the robot."""

import time
from dataclasses import replace

import pytest
from coglab_console.desk.commands import COMMANDS, BadCommand, judge
from coglab_console.desk.control_conditions import Standing, reasons
from coglab_console.desk.desk import ABSENCE, NOTICE, Roles
from coglab_console.desk.experiment import Experiment, ExperimentError
from coglab_console.desk.motion_guard import MotionGuard
from coglab_py.orders import latin_row, order_of
from console_double import READY
from desk_double import Clock, ask, hold_for, shown

# --- roles ----------------------------------------------------------------------------------------------------


def test_the_first_operates_and_the_others_watch(desk):
    assert ask(desk, "a", "home")["success"]
    answer = ask(desk, "b", "home")
    assert not answer["success"] and "operator" in answer["message"]
    assert [name for name, _ in desk.backend.calls] == ["home"]


def test_everybody_stops_and_notes(desk):
    for who in ("a", "b"):
        assert ask(desk, who, "stop")["success"]
        assert ask(desk, who, "note", text="x")["success"]
    assert desk.backend.stops == ["a", "b"]


def test_notes_and_next_object_are_published_and_received(desk):
    assert ask(desk, "b", "note", text="hesitated")["success"]
    assert ask(desk, "a", "select_object", object_id="mug")["success"]
    assert desk.backend.published == [("note", "hesitated"), ("select_object", "mug")]
    desk.set_from_topic("note", "from a terminal", "/rostopic_1")
    desk.set_from_topic("select_object", "ball", "/rostopic_1")
    assert desk.object_id == "ball" and [row["who"] for row in desk.experiment.notes] == ["b", "/rostopic_1"]
    for name, text in (("note", ""), ("note", "x" * 501), ("select_object", "no such; name")):
        desk.set_from_topic(name, text, "/x")
    assert desk.object_id == "ball" and len(desk.experiment.notes) == 2
    events = [event["text"] for event in desk.events.since(0)[0] if event["level"] == "warning"]
    assert len(events) == 3 and all(text.startswith("/x: ") for text in events)


@pytest.mark.parametrize(
    "name, arguments",
    [
        ("feedback", {"verb": "disable", "name": "x"}),
        ("feedback_order", {"names": ["b", "a"]}),
        ("contact_learn", {}),
        ("contact_arm", {"mode": "contact", "k": 3}),
        ("objects_reload", {}),
    ],
)
def test_changes_without_visible_effect_need_a_held_button(desk, name, arguments):
    """One click changes no feedback controller, also between trials."""
    assert "hold" in ask(desk, "a", name, **arguments)["message"] and not desk.backend.calls
    (answer,) = hold_for(desk, 1.0, what=(name, arguments))
    assert answer["success"] and desk.backend.calls == [(name, arguments)]


def test_taking_over_is_announced_and_may_be_refused():
    said, clock = [], Clock()
    roles = Roles(lambda text, level: said.append(text), clock)
    roles.connected("a")
    roles.connected("b")
    roles.take_over("b")
    assert roles.operator == "a" and "takes over" in said[-1]
    clock.time += NOTICE - 0.1
    assert not roles.tick()
    roles.keep("a")
    clock.time += 1.0
    assert not roles.tick() and roles.operator == "a"
    roles.take_over("b")
    clock.time += NOTICE
    assert roles.tick() and roles.operator == "b" and said[-1].startswith("b ")


def test_two_browsers_want_to_operate_and_one_disconnects():
    clock = Clock()
    roles = Roles(lambda text, level: None, clock)
    for name in "abc":
        roles.connected(name)
    roles.take_over("b")
    assert roles.take_over("c") and roles.view()["claimant"] == "b"
    roles.disconnected("b")
    assert roles.view()["claimant"] == ""
    roles.disconnected("a")
    clock.time += ABSENCE - 0.1
    assert not roles.tick() and roles.operator == "a"  # a reload is no farewell
    roles.connected("a")
    clock.time += ABSENCE
    assert not roles.tick() and roles.operator == "a"


def test_role_of_absent_operator_becomes_free():
    """Its browser was closed: the next browser operates, and observers see how to take over."""
    said, clock = [], Clock()
    roles = Roles(lambda text, level: said.append(text), clock)
    roles.connected("a")
    roles.connected("b")
    roles.disconnected("a")
    clock.time += ABSENCE + 0.1
    assert roles.tick() and roles.operator == "" and "Take over" in said[-1]
    assert not roles.tick()
    roles.connected("c")
    assert roles.operator == "c"


# --- reasons --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change, button, part",
    [
        ({}, "exchange_human_to_robot", ""),
        ({"object_id": "mug"}, "exchange_human_to_robot", ""),  # what the machine takes is its own matter
        ({"actions": ()}, "take", "takes nothing"),
        ({"in_hub": False, "state": "/m/approach", "actions": ()}, "take", "busy: it reaches"),
        ({"master_alive": False}, "take", "not there"),
        ({}, "exchange_robot_to_human", "empty"),
        ({"state": "/m/stopped", "actions": ("reset",)}, "take", "Go on"),
        ({"hand_connected": False}, "calibrate", "does not answer"),
        ({"motion_allowed": False, "arm_reason": "hold is latched"}, "home", "hold is latched"),
        ({"arm_alive": False}, "home", "not there"),
    ],
)
def test_reasons(change, button, part):
    found = reasons(replace(Standing(**READY), **change), MotionGuard())[button]
    assert (found == "") == (part == "") and part in found


def test_thresholds_do_not_change_under_way(desk):
    assert ask(desk, "a", "contact_arm", mode="off")["success"]
    desk.backend.now = replace(desk.backend.now, in_hub=False)
    for name, arguments in (("contact_arm", {"mode": "off"}), ("feedback", {"verb": "pause", "name": "x"})):
        assert "under way" in ask(desk, "a", name, **arguments)["message"]


def test_thresholds_stay_while_brain_is_silent_in_an_action(desk):
    """The brain may only be frozen and continue later."""
    desk.backend.now = replace(desk.backend.now, in_hub=False, master_alive=False)
    for name, arguments in (("contact_arm", {"mode": "off"}), ("calibrate", {"mode": "fast"}), ("home", {})):
        assert "under way" in ask(desk, "a", name, **arguments)["message"]
    desk.backend.now = replace(desk.backend.now, master_there=False)
    assert ask(desk, "a", "home")["success"]


# --- commands -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, arguments",
    [
        ("nothing", {}),
        ("speed_scale", {"value": 1.5}),
        ("speed_scale", {"value": "1"}),
        ("start", {"action": "take", "object_id": "a b"}),
        ("note", {"text": "x" * 501}),
        ("contact_arm", {"mode": "contact", "k": 1}),
        ("contact_arm", {"mode": "contact", "joints": [0]}),
        ("session_begin", {"participant": "../x", "conditions": ["a"], "repetitions": 1, "order": "random"}),
        ("feedback", {"verb": "load", "name": "x"}),
    ],
)
def test_arguments_outside_the_schema_are_refused(name, arguments):
    with pytest.raises(BadCommand):
        judge(name, arguments)


def test_users_action_is_allowed_only_while_the_machine_accepts_it(desk):
    """A double of the robot that takes it now; a delivery goes along."""
    standing = desk.backend.standing()
    desk.backend.standing = lambda: replace(standing, actions=(*standing.actions, "polish"))
    assert shown(desk)["own"] == ["polish"] and shown(desk)["reasons"]["polish"] == ""
    refused = ask(desk, "a", "start", action="drop_it")
    assert not refused["success"] and "now only" in refused["message"] and "polish" in refused["message"]
    assert ask(desk, "a", "start", action="polish", delivery="rim_first")["success"]
    assert desk.backend.calls[-1] == ("start", {"action": "polish", "delivery": "rim_first"})


def test_every_motion_is_the_operators_alone():
    assert all(command.operator for command in COMMANDS.values() if command.motion)
    assert not COMMANDS["stop"].operator


# --- sessions -------------------------------------------------------------------------------------------------


def test_a_balanced_latin_square():
    for n in (2, 4, 6):
        names = [str(i) for i in range(n)]
        rows = [latin_row(names, i) for i in range(n)]
        assert all(sorted(column) == names for column in zip(*rows, strict=True))
        pairs = [(a, b) for row in rows for a, b in zip(row, row[1:], strict=False)]
        assert len(set(pairs)) == n * (n - 1)
    rows = [latin_row(["a", "b", "c"], i) for i in range(6)]
    pairs = [(a, b) for row in rows for a, b in zip(row, row[1:], strict=False)]
    assert all(pairs.count(pair) == 2 for pair in pairs)


@pytest.mark.parametrize("order", ["as_listed", "latin_square", "random"])
def test_each_block_holds_each_condition_once(order, tmp_path):
    trials = order_of(["a", "b", "c"], 4, order, 7)
    assert all(sorted(trials[i : i + 3]) == ["a", "b", "c"] for i in range(0, 12, 3))
    assert trials == order_of(["a", "b", "c"], 4, order, 7)
    with pytest.raises(ExperimentError):
        Experiment(tmp_path, time.time, lambda text: None).begin("p1", ["a"] * 12, 51, order, 0)


def test_the_steps_of_a_session(tmp_path):
    session = Experiment(tmp_path, time.time, lambda text: None)
    with pytest.raises(ExperimentError):
        session.trial_begin()
    session.begin("P07", ["receive", "give"], 1, "as_listed", 0)
    with pytest.raises(ExperimentError):
        session.begin("P08", ["x"], 1, "as_listed", 0)
    session.trial_begin()
    session.note("a", "hesitated")
    session.trial_end("repeat")
    session.trial_begin()
    session.trial_end("done")
    session.trial_begin()
    session.trial_end("skipped")
    with pytest.raises(ExperimentError):
        session.trial_begin()
    assert "1 of 2" in session.end() and not any(tmp_path.iterdir())


def test_a_full_disk_is_told_and_the_session_goes_on(tmp_path):
    said = []
    session = Experiment(tmp_path, time.time, said.append)
    session.begin("P07", ["a"], 1, "as_listed", 0)
    (tmp_path / "session.json").unlink()
    (tmp_path / "session.json").mkdir()
    session.note("a", "x")
    assert "session.json" in said[0] and session.view()["participant"] == "P07"
