"""After a stop: acknowledgement, held button, and start of a motion."""

import asyncio
from dataclasses import replace

import pytest
from coglab_console.desk.desk import DeskReply
from coglab_console.desk.motion_guard import HOLD_TIME, HeldButton, MotionGuard, Standstills
from desk_double import RECEIVE, Clock, ask, buttons_follow, hold_for, newest, shown


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


def test_acknowledgement_of_old_stop_does_not_lift_newer_stop(desk):
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


def test_fault_after_stop_without_motion_counts_as_new_stop(desk):
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


def test_short_stop_between_two_polls_counts(desk):
    desk.observe(False, "")
    stands = Standstills()
    stands.arm(True)
    stands.arm(False)
    desk.observe(False, "", stands.count)
    assert desk.guard.unacknowledged


def test_hold_and_resulting_machine_stop_count_as_one():
    stands = Standstills()
    stands.machine("/m/wait_without_object")
    stands.arm(True)
    for state in ("/m/stopped", "/m/stopped"):
        stands.machine(state)
    assert stands.count == 1
    for state in ("/m/recover/end_motion", "/m/fault", "/m/fault", "/m/coglab_init_system/x", "/m/fault"):
        stands.machine(state)
    assert stands.count == 3


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


def test_button_held_during_its_own_command_is_not_refused(desk):
    """The command itself has changed the state by then."""
    clock = Clock()
    let = asyncio.Event()

    async def call(name, arguments):
        desk.backend.now = replace(desk.backend.now, calibrating=True)
        await let.wait()
        return DeskReply(True, "started")

    async def press():
        held = []
        for _ in range(12):
            held.append(asyncio.create_task(desk.held("a", "calibrate", {"mode": "complete"})))
            await asyncio.sleep(0)
            clock.time += 0.1
        let.set()
        answers = await asyncio.gather(*held)
        # A message that was on its way when the answer left.
        answers.append(await desk.held("a", "calibrate", {"mode": "complete"}))
        return [answer for answer in answers if answer is not None]

    desk.backend.call = call
    with buttons_follow(clock):
        answers = asyncio.run(press())
    assert [dict(answer) for answer in answers] == [{"success": True, "message": "started"}]
    desk.released("a")
    answer = asyncio.run(desk.held("a", "calibrate", {"mode": "complete"}))
    assert "calibrates" in answer["message"]


def test_a_calibration_is_not_the_first_motion_after_a_stop(desk):
    """It needs its own held button, and the first motion of the arm still needs one."""
    ask(desk, "a", "stop")
    ask(desk, "a", "acknowledge", stop=newest(desk))
    (answer,) = hold_for(desk, 1.0, what=("calibrate", {"mode": "fast"}))
    assert answer["success"] and desk.guard.needs_hold
    assert "hold" in ask(desk, "a", "start", **RECEIVE)["message"]


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


def test_holding_restarts_with_another_action():
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


def test_stop_lifted_in_a_terminal_is_shown_as_over(desk):
    """After `./coglab hold` and `./coglab start reset` the page does not request Go on: nothing waits for it."""
    desk.observe(False, "")
    ready = desk.backend.now
    desk.backend.now = replace(ready, state="/coglab_master/stopped", actions=("reset",))
    desk.observe(True, "the arm is blocked: hold is latched", 1)
    assert not shown(desk)["guard"]["lifted"] and shown(desk)["guard"]["cause"].endswith("press Go on")
    desk.backend.now = ready
    desk.observe(False, "", 1)
    guard = shown(desk)["guard"]
    assert guard["lifted"] and guard["unacknowledged"]
    assert "hold is latched" in guard["cause"] and "Go on" not in guard["cause"]
    desk.observe(True, "hold is latched", 2)
    assert not shown(desk)["guard"]["lifted"]
