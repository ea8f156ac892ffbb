"""What holds where nobody says otherwise: of a configuration that leaves something out, of states without a limit of
their own, of ports and settings."""

import dataclasses
import math

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.contact.detector import DetectorSettings
from coglab_smach.context.config import Config
from coglab_smach.context.journal import Failure, Journal, Wait
from coglab_smach.context.requests import Request
from coglab_smach.kinematics.motion_time import MotionLimits
from coglab_smach.ports.interfaces import (
    OLDEST_BELIEF,
    OLDEST_RECOGNITION,
    Ahead,
    ContactEvent,
    DmpProgress,
    DmpRequest,
    HandState,
    Recognition,
    Verdict,
)
from coglab_smach.simulated.cell import Faults, Partner
from conftest import SHARE, Trial
from test_every_state import leaves

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
OTHERWISE = {
    "approach_profile": [""],
    "ptp_velocity": [[]],
    "handover.approach": [0.08],
    "handover.arrival_speed": [0.0],
    "handover.belief": [0.85],
    "handover.belief_request": [0.85],
    "handover.region_low": [[-1.0, -1.0, -1.0]],
    "handover.region_high": [[1.5, 1.0, 2.0]],
    "hand.lift_after": [0.1],
    "hand.lift_speed": [0.01, 0.03],
    "hand.tighten.medium": [200],
    "give.goal_leaves": [0.02],
    "give.touch_within": [0.05],
    "give.ease_speed": [100],
    "monitor.primitives": [{}],
    "recognition_trigger.actions": [{}],
    "lwr_commands": [["position", "start"]],
    "board.room": [0.01],
}
"""names whose default is not what the shipped file has, with it or them"""
NEEDED = {"controllers", "dmp_library", "postures.home", "postures.board"}
"""without these a machine cannot work"""


def session(t):
    """All four actions, a start on a belief, and an arm that is held in a hub; the hand is calibrated twice."""
    t.wait_hub("wait_without_object", 200.0)
    for action, hub in (
        ("take", "wait_with_object"),
        ("put", "wait_without_object"),
        (RECEIVE, "wait_with_object"),
        (GIVE, "wait_without_object"),
    ):
        t.start(action)
        t.wait_hub(hub, 100.0)
    t.clock.sleep(0.5)
    t.cell.partner.offer = 0.95
    t.wait_hub("wait_with_object", 100.0)
    t.cell.faults.dead.add("arm")
    t.wait_hub("fault")
    t.cell.faults.dead.clear()
    t.cell.hand_positions = (0, 0, 0, 0, 0)
    t.start("initialise")
    t.wait_hub("wait_without_object", 200.0)


def late(t):
    """A person who is felt late, pulls and holds on; and then takes a part of the load, and presses."""
    t.cell.partner.touch_after, t.cell.partner.let_go_after, t.cell.partner.pattern = 4.0, None, "high"
    let_go, t.cell.let_go = t.cell.let_go, lambda: None
    t.wait_hub("wait_without_object", 200.0)
    t.start(RECEIVE)
    t.until(lambda: "arm lift" in t.cell.called())
    t.cell.pulled = (0.0, 9.0, 0.0)
    t.clock.sleep(0.3)
    t.cell.pulled = (0.0, 0.0, 0.0)
    t.cell.push(-3.0)
    t.clock.sleep(2.0)
    let_go()
    t.wait_hub("wait_with_object", 100.0)
    t.cell.partner.take_after = None
    for touch in (None, 5.0):
        t.cell.touch = touch
        t.cell.push(0.0)
        t.start(GIVE)
        t.until(lambda: t.cell.called("arm")[-1] == "arm release")
        for push in (1.5, 0.0, -5.0, 0.0):
            t.cell.push(push)
            t.clock.sleep(1.2)
        t.wait_hub("wait_with_object", 100.0)


@pytest.fixture(scope="module")
def asked():
    """name -> the defaults with which a configuration was asked for it, in sessions of all that happens."""
    found = {}

    def record(config):
        get = config.get

        def ask(name, default=None):
            if default not in found.setdefault(name, []):
                found[name].append(default)
            return get(name, default)

        config.get = ask

    for script, settings in (
        (session, {"approach_profile": "dmp_compliant", "recognition_trigger.enabled": True}),
        (late, {"auto_trigger": True, "give.near": 2.0}),
    ):
        trial = Trial(**settings)
        record(trial.ctx.config)
        trial.run(script)
    return found


def test_a_file_that_leaves_something_out_gets_what_the_shipped_one_has(asked):
    shipped = Config.load(str(SHARE / "config" / "machines.yaml"), {"dmp_library": ""})
    for name in NEEDED:
        assert asked.pop(name) == [None], name
    wanted = {name: OTHERWISE.get(name) or [shipped.get(name, {})] for name in asked}
    other = {
        name: (asked[name], wanted[name])
        for name in asked
        if sorted(map(str, asked[name])) != sorted(map(str, wanted[name]))
    }
    assert other == {}, "name: (defaults, as expected)"


def test_nearly_all_that_the_file_has_was_asked_for(asked):
    """Else the test before says little."""
    assert len(asked) > 85, sorted(asked)


LIMITS = {
    "CalibrateHand": 30.0,
    "CheckStop": 10.0,
    "ConfigureLwr": 45.0,
    "EndMotion": 12.0,
    "ExecuteDmp": 5.0,
    "FindPlace": 8.0,
    "GiveLoad": 20.0,
    "HandClose": 12.0,
    "HandOpen": 8.0,
    "HandPreshape": 6.0,
    "HandTighten": 5.0,
    "HomeRobot": 20.0,
    "InitVision": 30.0,
    "LetGo": 8.0,
    "LoadControllers": 40.0,
    "LoadDmps": 15.0,
    "LocateOnBoard": 12.0,
    "MonitorDmp": 600.0,
    "PtpMotion": 20.0,
    "QueryDatabase": 5.0,
    "Seat": 6.0,
    "SecureHand": 10.0,
    "SetDeliveryGoal": 20.0,
    "SetGraspGoal": 20.0,
    "SetPlaceGoal": 8.0,
    "SetTakeGoal": 8.0,
    "SwitchController": 5.0,
    "TakeWeight": 16.0,
    "WaitForTrigger": 3600.0,
    "WaitStop": 20.0,
    "WaitTaker": 20.0,
    "WhatIsHeld": 8.0,
}
"""s, of a state that waits for nobody without end"""
MOVES = {"ExecuteDmp", "GiveLoad", "HandClose", "HomeRobot", "LetGo", "PtpMotion", "Seat", "SwitchController"}
MOVES |= {"TakeWeight", "WaitStop", "WaitTaker"}
DEAF = {"CheckStop", "EndMotion", "Fault", "Stopped"}


def test_of_each_state_its_limit_whether_it_moves_the_arm_and_whether_it_obeys_stop(trial):
    found = {type(state).__name__: state for _, state, _ in leaves(trial.master)}
    timed = {name: state.time_limit() for name, state in found.items() if math.isfinite(state.time_limit())}
    assert timed == LIMITS
    assert {name for name, state in found.items() if state.owns_motion} == MOVES
    assert {name for name, state in found.items() if state.ignores_stop} == DEAF
    assert {name for name, state in found.items() if not state.essential} == {"MonitorDmp"}
    trial.ctx.config.set("time_limits", {"hand_close": 3.5})
    assert {state.label: state.time_limit() for _, state, _ in leaves(trial.master)}["hand_close"] == 3.5


def test_settings_of_the_detector():
    assert dataclasses.asdict(DetectorSettings()) == {
        "cutoff": 20.0,
        "window": 0.04,
        "still_speed": 0.02,
        "settle": 0.25,
        "k": 6.0,
        "confirm": 3,
        "learn_samples": 100,
        "floor": 0.02,
        "offset_threshold": 1.2,
        "sensitivity_share": 0.5,
        "load_share": 0.5,
        "release_confirm": 0.05,
        "load_confirm": 0.3,
        "user_direction": (1.0, 0.0, 0.0),
    }


def test_what_ports_tell_and_take_without_more_words():
    assert (Verdict(True).why, Verdict(True).code) == ("", ReasonCode.NONE)
    asked = dataclasses.asdict(DmpRequest("p", "f", (1.0, 2.0, 3.0)))
    zeros = ("goal_approach", "goal_region_low", "goal_region_high")
    assert all(asked[name] == (0.0, 0.0, 0.0) for name in zeros) and asked["target_orientation"] == (0.0,) * 4
    assert (asked["dmp_ratio"], asked["arrival_speed"], asked["goal_retreat"], asked["goal_drop"]) == (1.0, 0, 0, 0)
    assert asked["orientation_control"] is False
    assert dataclasses.astuple(DmpProgress()) == ("idle", "", "", 0.0, 0.0, 0, 0.0)
    assert dataclasses.astuple(ContactEvent(True, "x", 2.0)) == (True, "x", 2.0, "", 1.0, 0)
    assert dataclasses.astuple(HandState()) == (False, False, False, False, "", (), 0)
    assert dataclasses.astuple(Recognition()) == ("unknown", 0.0, False, {})
    assert dataclasses.astuple(Ahead()) == (0.0, 0.0, "", "", (0.0, 0.0, 0.0), 0.0)
    assert (OLDEST_BELIEF, OLDEST_RECOGNITION) == (0.3, 0.5)
    assert MotionLimits((), (), (), ()).hand_speed == math.inf


def test_what_nobody_has_said_yet():
    assert dataclasses.astuple(Failure()) == ("", (), 0) and dataclasses.astuple(Request("put")) == (
        "put",
        "",
        "operator",
    )
    assert Wait() == Wait("", math.inf, 0, False)
    journal = Journal(lambda: 0.0, keep=3)
    for k in range(5):
        journal.transition("/m", str(k), "succeeded", "next", "")
    assert [t.from_state for t in journal.transitions] == ["2", "3", "4"] and journal.transitions[0].code == 0
    whole = Journal(lambda: 0.0)
    for k in range(2001):
        whole.transition("/m", str(k), "succeeded", "next", "")
    assert (len(whole.transitions), whole.transitions[0].from_state) == (2000, "1")
    ctx = Trial().ctx
    assert (ctx.shared, ctx.firm, ctx.preshaped, ctx.closing, ctx.closing_on, ctx.closing_firm) == (
        False,
        0,
        False,
        None,
        "",
        0,
    )
    ctx.holding, ctx.firm = "mug", 140
    ctx.holding = ""
    assert ctx.firm == 0, "an empty hand holds nothing firmly"


def test_a_cell_in_which_nothing_is_broken():
    assert dataclasses.asdict(Faults()) == {
        "dead": set(),
        "refuse": {},
        "not_seen": set(),
        "abort_dmp_after": 0.0,
        "abort_reason": "goal lost for 1.0 s",
        "arm_disabled": "",
        "empty_grasp": False,
    }
    assert dataclasses.asdict(Partner()) == {
        "touch_after": 0.8,
        "take_after": 1.0,
        "let_go_after": 0.2,
        "away": 1.0,
        "offer": 0.0,
        "request": 0.0,
        "pattern": "unknown",
        "pattern_at": 0.0,
    }
