"""Who may do what and when: roles, the acts after a stop, held buttons, sessions; with a double of the robot."""

import asyncio
import json
import time
from dataclasses import replace

import pytest
from coglab_console.desk.commands import COMMANDS, BadCommand, judge
from coglab_console.desk.desk import Desk
from coglab_console.desk.events import EventLog
from coglab_console.desk.experiment import Experiment, ExperimentError, latin_row, order_of
from coglab_console.desk.gates import MotionGuard, Standing, Standstills, reasons
from coglab_console.desk.hold import HOLD_TIME, HeldButton
from coglab_console.desk.roles import ABSENCE, NOTICE, Roles
from coglab_console.web.fan_out import Documents
from console_double import READY, RobotDouble, running

RECEIVE = {"action": "exchange_human_to_robot"}


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def desk(tmp_path):
    robot = RobotDouble()
    made = Desk(robot, EventLog(time.time), Documents(), tmp_path, time.time, lambda: "http://link")
    made.connected("a")
    made.connected("b")
    return made


def ask(desk, who, command, /, **arguments):
    return asyncio.run(desk.command(who, command, arguments))


# --- roles ----------------------------------------------------------------------------------------------------


def test_the_first_operates_and_the_others_watch(desk):
    assert ask(desk, "a", "home")["success"]
    answer = ask(desk, "b", "home")
    assert not answer["success"] and "a is the operator" in answer["message"]
    assert [name for name, _ in desk.backend.calls] == ["home"]


def test_everybody_stops_and_notes(desk):
    for who in ("a", "b"):
        assert ask(desk, who, "stop")["success"]
        assert ask(desk, who, "note", text="x")["success"]
    assert desk.backend.stops == ["a", "b"]


def test_notes_and_the_next_object_are_told_to_ros_and_heard_from_there(desk):
    assert ask(desk, "b", "note", text="hesitated")["success"]
    assert ask(desk, "a", "select_object", object_id="mug")["success"]
    assert desk.backend.told == [("note", "hesitated"), ("select_object", "mug")]
    desk.told("note", "from a terminal", "/rostopic_1")
    desk.told("select_object", "ball", "/rostopic_1")
    assert desk.object_id == "ball" and [row["who"] for row in desk.experiment.notes] == ["b", "/rostopic_1"]
    for name, text in (("note", ""), ("note", "x" * 501), ("select_object", "no such; name")):
        desk.told(name, text, "/x")
    assert desk.object_id == "ball" and len(desk.experiment.notes) == 2
    events = [event["text"] for event in desk.events.since(0)[0] if event["level"] == "warning"]
    assert len(events) == 3 and all(text.startswith("/x: ") for text in events)


@pytest.mark.parametrize(
    "name, arguments",
    [
        ("feedback", {"verb": "disable", "name": "x"}),
        ("feedback_order", {"names": ["b", "a"]}),
        ("contact_learn", {}),
    ],
)
def test_what_nobody_sees_at_once_is_held_down(desk, name, arguments):
    """One click changes no feedback controller, also between trials."""
    assert "hold the button" in ask(desk, "a", name, **arguments)["message"] and not desk.backend.calls
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
    assert roles.tick() and roles.operator == "b" and "b is the operator now" in said[-1]


def test_two_who_want_to_operate_and_one_who_went_away():
    clock = Clock()
    roles = Roles(lambda text, level: None, clock)
    for name in "abc":
        roles.connected(name)
    roles.take_over("b")
    assert "taking over already" in roles.take_over("c")
    roles.disconnected("b")
    assert roles.view()["claimant"] == ""
    roles.disconnected("a")
    assert roles.operator == "a"  # a reload is no farewell
    clock.time += ABSENCE + 0.1
    assert "you are the operator" in roles.take_over("c") and roles.operator == "c"


# --- after a stop ---------------------------------------------------------------------------------------------


def test_after_a_stop_acknowledge_then_hold(desk):
    ask(desk, "b", "stop")
    assert "acknowledge" in ask(desk, "a", "start", **RECEIVE)["message"]
    assert not ask(desk, "b", "acknowledge", stop=newest(desk))["success"]  # an observer
    assert ask(desk, "a", "acknowledge", stop=newest(desk))["success"]
    assert "hold" in ask(desk, "a", "start", **RECEIVE)["message"]
    assert desk.backend.calls == []


def test_a_stop_by_somebody_else_counts(desk):
    desk.observe(False, "")
    desk.observe(True, "hold on /lwr")
    assert desk.guard.unacknowledged and desk.guard.cause == "hold on /lwr"
    ask(desk, "a", "acknowledge", stop=newest(desk))
    desk.observe(True, "hold on /lwr")
    assert not desk.guard.unacknowledged  # the same stop


def shown(desk):
    """The document of the desk, as the page has it."""
    desk.tick()
    documents = [json.loads(text) for text in desk.documents.newer({})]
    return next(one["value"] for one in documents if one["name"] == "desk")


def newest(desk):
    """Number of the newest stop."""
    return shown(desk)["guard"]["stop"]


def test_an_acknowledgement_names_its_stop_and_lifts_no_newer_one(desk):
    stop = ask(desk, "a", "stop")["data"]["stop"]
    assert stop == newest(desk)
    desk.observe(True, "the arm is blocked: no datagrams")
    refused = ask(desk, "a", "acknowledge", stop=stop)
    assert not refused["success"] and "no datagrams" in refused["message"] and desk.guard.unacknowledged
    assert not ask(desk, "a", "acknowledge")["success"]
    assert not ask(desk, "a", "acknowledge", stop=newest(desk) + 1)["success"] and desk.guard.unacknowledged
    answer = ask(desk, "a", "acknowledge", stop=newest(desk))
    assert answer["success"] and "no datagrams" in answer["message"] and not desk.guard.unacknowledged
    events = [event["text"] for event in desk.events.since(0)[0] if event["source"] == "command"]
    assert any(f"stop {newest(desk)}" in text and "no datagrams" in text for text in events)


def test_without_a_stop_nothing_is_acknowledged(desk):
    answer = ask(desk, "a", "acknowledge", stop=0)
    assert not answer["success"] and "no stop" in answer["message"]


def test_a_fault_after_a_stop_is_a_stop_of_its_own_though_the_robot_never_moved(desk):
    """STOP, acknowledged, `./coglab start reset`: the arm does not obey, and the machine goes from stopped to fault."""
    stands = Standstills()
    stands.arm(True)
    stands.machine("/coglab_master/stopped")
    desk.observe(True, "STOP", stands.count)
    ask(desk, "a", "acknowledge", stop=newest(desk))
    stands.arm(False)
    stands.machine("/coglab_master/fault")
    desk.observe(True, "no command mode", stands.count)
    assert desk.guard.unacknowledged and desk.guard.needs_hold and desk.guard.cause == "no command mode"
    told = [event["text"] for event in desk.events.since(0)[0] if event["source"] == "stop"]
    assert told == ["stopped: STOP", "stopped: no command mode"]


def test_a_stop_that_was_over_between_two_looks_counts(desk):
    desk.observe(False, "")
    stands = Standstills()
    stands.arm(True)
    stands.arm(False)
    desk.observe(False, "", stands.count)
    assert desk.guard.unacknowledged


def test_a_hold_and_the_machine_that_stops_because_of_it_are_one_stop():
    stands = Standstills()
    stands.machine("/m/wait_without_object")
    stands.arm(True)
    for state in ("/m/stopped", "/m/stopped"):
        stands.machine(state)
    assert stands.count == 1
    for state in ("/m/recover/end_motion", "/m/fault", "/m/fault", "/m/coglab_init_system/x", "/m/fault"):
        stands.machine(state)
    assert stands.count == 3


def hold_for(desk, seconds, gap=0.1, who="a", what=("start", RECEIVE)):
    clock = Clock()
    desk._held[who] = HeldButton(clock)

    async def press():
        answers = []
        for _ in range(round(seconds / gap)):
            answers.append(await desk.held(who, *what))
            clock.time += gap
        return [answer for answer in answers if answer is not None]

    return asyncio.run(press())


def test_a_held_button_begins_the_motion_once(desk):
    ask(desk, "a", "stop")
    ask(desk, "a", "acknowledge", stop=newest(desk))
    assert hold_for(desk, 0.6) == []
    desk.released("a")
    answers = hold_for(desk, 1.4)
    assert len(answers) == 1 and answers[0]["success"]
    assert len(desk.backend.calls) == 1
    assert not desk.guard.needs_hold
    assert ask(desk, "a", "start", **RECEIVE)["success"]  # the next one needs a press only


def test_a_browser_that_dies_with_the_button_held_starts_nothing():
    clock = Clock()
    button = HeldButton(clock)
    for _ in range(7):
        assert not button.held("x")
        clock.time += 0.1
    clock.time += 5.0  # nothing came any more
    assert not button.held("x")


@pytest.mark.parametrize("gap", [0.3, 0.5])
def test_a_held_button_with_gaps_starts_nothing(gap):
    clock = Clock()
    button = HeldButton(clock)
    for _ in range(20):
        assert not button.held("x")
        clock.time += gap


def test_another_action_begins_the_holding_anew():
    clock = Clock()
    button = HeldButton(clock)
    for what in "aaaaaabbbbbb":
        assert not button.held(what)
        clock.time += HOLD_TIME / 8


def test_observers_and_unknown_commands_cannot_hold(desk):
    async def press():
        return [
            await desk.held("b", "start", RECEIVE),
            await desk.held("a", "nothing", {}),
            await desk.held("a", "home", {"x": 1}),
        ]

    assert all(answer is not None and not answer["success"] for answer in asyncio.run(press()))


def test_the_real_robot_and_calibrations_that_open_the_hand_need_a_held_button():
    guard = MotionGuard(real=True)
    assert guard.guarded("home", {})
    plain = MotionGuard()
    assert not plain.guarded("calibrate", {"mode": "fast"})
    assert plain.guarded("calibrate", {"mode": "fast", "force": True})
    assert plain.guarded("calibrate", {"mode": "complete"})


# --- reasons --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change, button, part",
    [
        ({}, "exchange_human_to_robot", ""),
        ({"object_id": "mug"}, "exchange_human_to_robot", ""),  # what the machine takes is its own matter
        ({"actions": ()}, "take", "takes nothing"),
        ({"in_hub": False, "state": "/m/approach", "actions": ()}, "take", "approach is under way"),
        ({"master_alive": False}, "take", "not there"),
        ({}, "exchange_robot_to_human", "the hand is empty"),
        ({"state": "/m/stopped", "actions": ("reset",)}, "take", "only reset leads on"),
        ({"hand_connected": False}, "calibrate", "does not answer"),
        ({"motion_allowed": False, "arm_reason": "hold is latched"}, "home", "hold is latched"),
        ({"arm_alive": False}, "home", "not there"),
    ],
)
def test_reasons(change, button, part):
    found = reasons(replace(Standing(**READY), **change), MotionGuard())[button]
    assert (found == "") == (part == "") and part in found


def test_a_reason_is_short_enough_to_stand_below_its_button():
    """Three lines; the whole of it is in the status column."""
    told = "command mode was lost because the robot controller was not run for 259 ms (load); now: no datagrams"
    for arm_reason in (told, "x" * 200):
        standing = replace(Standing(**READY), motion_allowed=False, arm_reason=arm_reason)
        found = reasons(standing, MotionGuard())["home"]
        assert found.startswith("the arm may not move: ") and len(found) <= 50
    standing = replace(Standing(**READY), motion_allowed=False, arm_reason=told)
    assert reasons(standing, MotionGuard())["home"] == "the arm may not move: command mode was lost"


def test_thresholds_do_not_change_under_way(desk):
    assert ask(desk, "a", "contact_arm", mode="off")["success"]
    desk.backend.now = replace(desk.backend.now, in_hub=False)
    for name, arguments in (("contact_arm", {"mode": "off"}), ("feedback", {"verb": "pause", "name": "x"})):
        assert "under way" in ask(desk, "a", name, **arguments)["message"]


# --- commands -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, arguments",
    [
        ("nothing", {}),
        (None, {}),
        (["home"], {}),
        ("home", None),
        ("home", []),
        ("speed_scale", {"value": 1.5}),
        ("speed_scale", {}),
        ("speed_scale", {"value": "1"}),
        ("start", {"action": "take", "object_id": "a b"}),
        ("note", {"text": ""}),
        ("note", {"text": "x" * 501}),
        ("contact_arm", {"mode": "contact", "k": 1}),
        ("contact_arm", {"mode": "contact", "joints": [0]}),
        ("session_begin", {"participant": "../x", "conditions": ["a"], "repetitions": 1, "order": "random"}),
        ("feedback", {"verb": "load", "name": "x"}),
    ],
)
def test_what_fits_no_schema_is_refused(name, arguments):
    with pytest.raises(BadCommand):
        judge(name, arguments)


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
def test_each_block_holds_each_condition_once(order):
    trials = order_of(["a", "b", "c"], 4, order, 7)
    assert all(sorted(trials[i : i + 3]) == ["a", "b", "c"] for i in range(0, 12, 3))
    assert trials == order_of(["a", "b", "c"], 4, order, 7)
    with pytest.raises(ExperimentError):
        order_of(["a"] * 12, 51, order, 0)


def test_the_file_of_a_session(tmp_path):
    session = Experiment(tmp_path, time.time, lambda text: None)
    with pytest.raises(ExperimentError):
        session.trial_begin()
    session.begin("P07", ["receive", "give"], 1, "as_listed", 0)
    with pytest.raises(ExperimentError):
        session.begin("P08", ["x"], 1, "as_listed", 0)
    session.trial_begin()
    session.record("result", kind="take", outcome="succeeded")
    session.note("a", "hesitated")
    session.trial_end("repeat")
    session.trial_begin()
    session.trial_end("done")
    session.trial_begin()
    session.trial_end("skipped")
    with pytest.raises(ExperimentError):
        session.trial_begin()
    session.end()
    (path,) = tmp_path.glob("P07_*.jsonl")
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    assert [row["type"] for row in rows] == [
        "session",
        "trial_begin",
        "result",
        "note",
        "trial_end",
        "trial_begin",
        "trial_end",
        "trial_begin",
        "trial_end",
        "session_end",
    ]
    assert rows[2]["trial"] == 1 and rows[5]["trial"] == 1 and rows[7]["condition"] == "give" and rows[-1]["done"] == 1


def test_a_full_disk_is_told_and_the_session_goes_on(tmp_path):
    said = []
    session = Experiment(tmp_path, time.time, said.append)
    session.begin("P07", ["a"], 1, "as_listed", 0)
    session._path = tmp_path / "gone" / "x.jsonl"
    session.note("a", "x")
    assert "cannot be written" in said[0] and session.view()["participant"] == "P07"


# --- over the wire --------------------------------------------------------------------------------------------


def test_a_connection_that_dies_with_the_button_held_starts_nothing(tmp_path):
    async def test():
        async with running(tmp_path) as console, console.browser() as client:
            ws = await console.socket_of(client)
            await ws.send_str("{}")
            console.desk.guard.stop("test")
            console.desk.guard.acknowledge(console.desk.guard.stops)
            for _ in range(6):
                await ws.send_str(json.dumps({"t": "hold", "name": "start", "arguments": RECEIVE}))
                await asyncio.sleep(0.1)
            ws._response.connection.transport.abort()
            await asyncio.sleep(1.2)
            assert console.robot.calls == []

    asyncio.run(test())
