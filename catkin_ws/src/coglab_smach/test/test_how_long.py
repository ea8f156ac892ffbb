"""How long each answer is waited for, from whom, and what a state may take: in sessions in which all of it happens."""

import re

import pytest
from coglab_smach.context import awaited
from coglab_smach.states import reach
from coglab_smach.states.base import CoglabState
from conftest import Trial
from test_defaults import RECEIVE, late, session

ANSWER, ARM, HAND, SIGHT, PERSON = awaited.ANSWER, awaited.ARM, awaited.HAND, awaited.SIGHT, awaited.PERSON
WHOLE = None
"""as long as the state has"""
WAITS = {
    "LWR command": {(WHOLE, ANSWER), (5.0, ANSWER), (20.0, ANSWER)},
    "a free place on the board": {(6.0, SIGHT)},
    "a sight of the object in the hand": {(2.0, SIGHT)},
    "all measured joints within 0.03 rad of posture": {(1.0, ARM)},
    "another reaching pattern": {(WHOLE, SIGHT)},
    "arming of the contact detector": {(2.0, ANSWER)},
    "closing of the hand": {(WHOLE, HAND)},
    "command mode of the LWR": {(WHOLE, ARM), (10.0, ARM)},
    "contact of an object with the hand": {(6.0, awaited.CONTACT)},
    "end of the reach by switching to": {(3.0, ANSWER)},
    "entry of": {(5.0, ANSWER)},
    "entry of object": {(WHOLE, ANSWER)},
    "feedback profile": {(2.0, ANSWER)},
    "hand calibration": {(WHOLE, HAND)},
    "loading plug-in of type": {(WHOLE, ANSWER)},
    "loading primitives of": {(WHOLE, ANSWER)},
    "news of the reach": {(2.0, ANSWER)},
    "opening of the empty hand": {(8.0, HAND)},
    "opening of the hand": {(WHOLE, HAND)},
    "preshape": {(WHOLE, HAND)},
    "rest of the arm": {(3.0, ARM)},
    "sight of": {(6.0, SIGHT), (0.5, SIGHT), (0.25, SIGHT)},
    "start of perception": {(WHOLE, SIGHT)},
    "start of primitive": {(3.0, ANSWER)},
    "switch to primitive": {(1.0, ANSWER)},
    "switching to": {(WHOLE, ANSWER), (3.0, ANSWER)},
    "switching to controller": {(WHOLE, ANSWER), (3.0, ANSWER), (5.0, ANSWER)},
    "the end of the approach's compliance": {(2.0, ANSWER)},
    "the hand's opening": {(5.0, HAND)},
    "the last of the way": {(3.0, ANSWER)},
    "the motion to posture": {(WHOLE, ARM)},
    "the person's taking of the load": {(8.0, PERSON)},
    "the share of the weight that the contact detector tells": {(1.0, ANSWER)},
    "the motion with the object": {(3.0, ANSWER)},
    "trigger": {(WHOLE, awaited.OPERATOR)},
}
"""what is waited for -> (s, code of whom) wherever it is"""
MOTIONS = {"drawing back", "the end of the reach", "the motion to posture", "the motion with the object"}
"""waits that count in the pace of the arm"""


def otherwise(t):
    """The arm meets something else, an object that is unknown after a restart, a STOP and command mode that is lost."""
    t.wait_hub("wait_trigger", 200.0)
    t.start("initialise", "")
    t.wait_hub("wait_without_object", 200.0)
    t.start(RECEIVE)
    t.clock.sleep(1.0)
    t.wait_hub("wait_with_object", 100.0)
    t.ctx.stop.press("the test")
    t.wait_hub("stopped")
    t.ctx.stop.reset()
    t.cell.arm.enabled = False
    t.ctx.holding = "unknown"
    t.start("reset", "")
    t.wait_hub("wait_with_object", 100.0)
    t.start("put", "mug")
    t.wait_hub("wait_without_object", 100.0)
    t.cell.faults.not_seen.add("mug")
    t.start(RECEIVE)
    t.wait_hub("wait_without_object", 100.0)


@pytest.fixture(scope="module")
def waited():
    """(state, what, s, whether in the pace of the arm, code) of every wait; (state, s) of what was allowed."""
    waits, allowed = set(), set()
    patch = pytest.MonkeyPatch()
    wait_for, allow, looks = CoglabState.wait_for, CoglabState.allow, []

    def waiting(self, condition, what, limit=None, pace=None, code=ANSWER):
        name = re.sub(r"\s+", " ", re.sub(r"'[^']*'( \(.*\))?|coglab/\w+|/\S+\.xml", "", what)).strip()
        waits.add((type(self).__name__, name, limit if limit is None else round(limit, 2), pace is not None, code))
        return wait_for(self, condition, what, limit, pace, code)

    def allowing(self, duration):
        allowed.add((type(self).__name__, round(duration, 2)))
        return allow(self, duration)

    patch.setattr(CoglabState, "wait_for", waiting)
    patch.setattr(CoglabState, "allow", allowing)
    try:
        Trial(approach_profile="dmp_compliant", **{"recognition_trigger.enabled": True}).run(session)
        Trial(**{"give.near": 2.0}).run(late)
        # Between the fingers at first, elsewhere at the touch.
        patch.setattr(reach, "off_grasp", lambda *_: looks.append(1) or (0.22 if len(looks) == 2 else 0.02))
        Trial(auto_trigger=False).run(otherwise)
    finally:
        patch.undo()
    return waits, allowed


def test_each_answer_has_its_time(waited):
    found = {}
    for _, what, seconds, _, code in waited[0]:
        found.setdefault(what, set()).add((seconds, code))
    ways = {"drawing back", "the end of the reach", "the person's letting go"}
    assert {what: found[what] for what in sorted(found) if what not in ways} == WAITS
    assert found.keys() >= ways


def test_waits_for_a_motion_count_in_its_pace_and_no_others(waited):
    assert {what for _, what, _, paced, _ in waited[0] if paced} == MOTIONS
    assert {what for _, what, _, paced, _ in waited[0] if not paced}.isdisjoint(MOTIONS)


def test_who_waits_for_what(waited):
    found = {(state, what): seconds for state, what, seconds, _, _ in waited[0]}
    assert found["Stopped", "LWR command"] in (5.0, 20.0) and found["Fault", "LWR command"] == 5.0
    assert found["ConfigureLwr", "command mode of the LWR"] is WHOLE
    assert found["Stopped", "command mode of the LWR"] == 10.0 and found["EndMotion", "switching to"] is WHOLE
    assert {s for state, what, s, _, _ in waited[0] if (state, what) == ("WaitStop", "sight of")} == {0.5, 0.25}
    assert {s for state, what, s, _, _ in waited[0] if (state, what) == ("SetTakeGoal", "sight of")} == {6.0}
    # 6 cm at 0.25 m/s, its start and end, and two seconds more.
    assert 2.24 < found["LetGo", "drawing back"] < 2.6 and 5.6 < found["WaitStop", "drawing back"] < 6.0
    # Between the closing and the person's letting go, which is measured from the arming.
    assert 4.8 < found["TakeWeight", "the person's letting go"] < 5.0


def test_a_reach_may_take_six_seconds_beyond_what_it_asks_for(waited):
    limits = {s for state, what, s, _, _ in waited[0] if what == "the end of the reach" and state == "WaitStop"}
    limit = Trial().ctx.arm.motion_limits()
    # 1.3 s of the primitive, 0.45 m and half a turn with the slowest joint, and its start.
    slowest = min(limit.velocity)
    asked = 1.3 + 0.45 / min(1.0, 0.4 * slowest) + 3.14159 / slowest + max(limit.velocity) / 10.0
    assert max(limits) == pytest.approx(6.0 + asked, abs=0.05)


def test_what_states_may_take_from_some_moment_on(waited):
    found = {}
    for state, seconds in waited[1]:
        found.setdefault(state, set()).add(seconds)
    assert found["GiveLoad"] == {18.0, 22.0}, "ten seconds beyond the person's eight, and to feel whether they hold it"
    assert {1.5, 1.6} <= found["HomeRobot"] and 1.5 in found["PtpMotion"]
    assert {11.0, 20.0} <= found["WaitStop"], "five beyond the contact's six; and to come again"
