"""The robot gives: the grip follows the person's share of the load, and every end without a taker keeps the object."""

from types import SimpleNamespace

import numpy as np
import pytest
import smach
from coglab_msgs.msg import ReasonCode, Say
from coglab_py.pose import Pose
from coglab_smach.context.grip import Grip
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import HandState, Located
from coglab_smach.ports.pending import Polled, Ready
from coglab_smach.states import give
from coglab_smach.states.held_object import HeldObject
from conftest import Trial

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
WEIGHT = 0.31 * 9.81


def giving(script, **overrides):
    """A master that offers the mug. The script acts for the person."""
    trial = Trial(**overrides)
    trial.cell.partner.take_after = None

    def walk(t):
        t.receive()
        t.cell.calls.clear()
        t.start(GIVE)
        t.until(lambda: "arm release" in t.cell.called())
        t.clock.sleep(1.0)
        script(t)

    return trial.run(walk)


def finger(trial):
    return trial.ctx.hand.state().positions[2]


def test_the_grip_loosens_with_the_load_and_closes_again_when_it_returns():
    def script(t):
        grip = finger(t)
        t.clock.sleep(0.5)
        assert finger(t) == grip and not t.cell.called("open"), "nobody has taken anything yet"
        loose = []
        for share in (0.35, 0.58):
            t.cell.push(share * WEIGHT)
            t.clock.sleep(0.8)
            loose.append(grip - finger(t))
        assert 0 < loose[0] < loose[1] <= 8, loose
        assert t.grip.shared, "the arm must not move away with a shared object"
        t.cell.push(0.0)
        t.clock.sleep(1.5)
        assert finger(t) == grip and t.cell.called("close") and not t.grip.shared
        t.wait_hub("wait_with_object")

    trial = giving(script)
    result = trial.result()
    assert result.outcome == "failed_holding" and result.code == ReasonCode.NOT_RELEASED
    assert trial.ctx.holding == "mug" and "8.0 s" in trial.ctx.journal.why()


def test_a_person_who_takes_the_load_gets_the_object():
    def script(t):
        t.cell.push(0.9 * WEIGHT)
        t.wait_hub("wait_without_object")

    trial = giving(script)
    assert trial.result().outcome == "succeeded" and trial.ctx.holding == ""


def test_the_arm_stays_while_the_person_carries_a_part_of_the_load():
    """At the time limit both hold the object: the grip closes, and the arm does not pull it away."""

    def script(t):
        t.cell.push(0.4 * WEIGHT)
        t.wait_hub("stopped")
        t.clock.sleep(1.0)

    trial = giving(script)
    assert trial.ctx.journal.results[-1].outcome == "stopped" and trial.ctx.holding == "mug"
    assert trial.cell.called("close") and finger(trial) == 160
    assert trial.ctx.journal.newest_failure().code == ReasonCode.NOT_RELEASED


def test_the_person_leaves_after_the_message_that_the_action_is_over():
    """The grip closes gently near the person's fingers, and firmly after they have left."""
    asked = []

    def script(t):
        close, say = t.ctx.hand.close, t.ctx.say

        def told(code, text):
            say(code, text)
            if code == Say.GIVEN_UP:
                t.cell.push(0.0)
                t.cell.objects["human_hand"] = Pose(np.array([1.4, 0.0, 0.4]))

        t.ctx.say, t.ctx.hand.close = told, lambda speed: asked.append(speed) or close(speed)
        t.cell.push(0.4 * WEIGHT)
        t.wait_hub("wait_with_object")

    trial = giving(script)
    result = trial.result()
    assert (result.outcome, result.code) == ("failed_holding", ReasonCode.NOT_RELEASED)
    assert trial.ctx.holding == "mug" and not trial.grip.shared
    gently, firmly = (trial.ctx.config.get(name) for name in ("give.close_speed", "hand.tighten.medium"))
    assert set(asked[:-1]) == {gently} and asked[-1] == firmly


@pytest.mark.parametrize("waits", [True, False])
def test_the_object_is_brought_to_a_hand_that_waits_elsewhere(monkeypatch, waits):
    """The hand hesitates beside the predicted place. A hand that still moves is left alone."""
    looks = []

    def way(state, object_id, delivery):
        looks.append(1)
        return np.array([0.1 if waits else 0.05 + 0.03 * (len(looks) % 5), 0.0, 0.0])

    monkeypatch.setattr(give, "way_to_hand", way)

    def script(t):
        t.clock.sleep(0.8)
        assert len(t.cell.called("move_ptp")) == (1 if waits else 0)
        t.wait_hub("wait_with_object")

    assert giving(script, **{"give.near": 2.0}).result().outcome == "failed_holding"


def test_a_hand_that_does_not_open_ends_at_its_time_limit():
    """A frozen node: the wait for the fingers ends, and the arm stays with the shared object."""

    def script(t):
        t.ctx.hand.preshape = lambda mode, level: Polled(lambda: False, lambda: None)
        t.cell.push(0.9 * WEIGHT)
        t.wait_hub("stopped", limit=40.0)
        t.clock.sleep(0.5)

    trial = giving(script)
    assert trial.ctx.journal.results[-1].outcome == "stopped" and trial.ctx.holding == "mug"
    assert "opening" in trial.ctx.journal.why()


@pytest.mark.parametrize(("pressed", "sinks"), [(0.5, 0), (1.5, 1)])
def test_the_arm_sinks_with_a_hand_that_presses_the_object_down(monkeypatch, pressed, sinks):
    """The object is too high for the hand at it. A torque error must not count as a hand."""
    monkeypatch.setattr(give, "way_to_hand", lambda *_: None)  # it is not brought anywhere

    def script(t):
        t.cell.push(-pressed * WEIGHT)
        t.clock.sleep(1.0)
        assert len(t.cell.called("move_ptp")) == sinks
        t.cell.push(0.0)
        t.wait_hub("wait_with_object")

    assert giving(script, **{"give.near": 2.0}).result().outcome == "failed_holding"


def test_stop_in_the_middle_closes_the_grip():
    def script(t):
        t.cell.push(0.5 * WEIGHT)
        t.clock.sleep(0.6)
        t.ctx.stop.press("by the test")
        t.wait_hub("stopped")
        assert t.cell.called("close") and t.ctx.holding == "mug"

    giving(script)


class Carried:
    """A standing hand with an object, seen at 30 Hz ``up`` m above its palm."""

    def __init__(self):
        posture = [0.0, 0.5, 0.0, 1.0, 0.0, 0.5, 0.0]
        self.palm, self.t, self.up, self.holding = default_arm().fk(posture)[0], 0.0, -0.07, True
        see = lambda *_: Ready(Located("", "world", (*self.palm[:2], self.palm[2] + self.up), (0, 0, 0, 1), 0.05))  # noqa: E731
        self.ctx = SimpleNamespace(
            arm=SimpleNamespace(joint_positions=lambda: tuple(posture)),
            hand=SimpleNamespace(state=lambda: HandState(True, True, False, self.holding)),
            perception=SimpleNamespace(locate_object=see),
            clock=SimpleNamespace(now=lambda: self.t),
            holding="mug",
        )
        self.grip = Grip(shared=True)
        self.held = HeldObject(self.ctx, "mug", self.grip)

    def look(self, duration=0.1):
        for _ in range(round(30 * duration)):
            self.t += 1 / 30
            self.held.check()
        return self.held


def test_sinking_in_the_hand_needs_two_sights():
    carried = Carried()
    assert carried.look().sunk == pytest.approx(0.0)
    carried.up -= 0.04
    assert carried.look(0.034).sunk == pytest.approx(0.0)
    assert carried.look(0.034).sunk == pytest.approx(0.04)


def test_an_object_that_falls_while_it_is_given_counts_as_failed():
    def script(t):
        t.cell.push(0.9 * WEIGHT)
        hand = t.cell.objects["human_hand"]
        while t.ctx.holding:
            t.clock.sleep(0.02)
        t.cell.at_palm = None
        t.cell.objects["mug"] = Pose(hand.position - [0.0, 0.0, 1.0])
        t.wait_hub("wait_without_object")

    trial = giving(script)
    assert trial.result().outcome == "failed_empty" and trial.result().code == ReasonCode.GOAL_FELL
    assert trial.ctx.holding == ""


def test_the_palm_retreats_while_the_hand_opens_then_the_person_is_informed():
    told = []

    def script(t):
        t.ctx.say = lambda code, text: told.append((t.clock.now(), code))
        t.cell.push(0.9 * WEIGHT)
        t.wait_hub("wait_without_object")

    trial = giving(script)
    assert trial.result().outcome == "succeeded"
    opening = trial.result().marks["opening"]
    after = [(stamp, name) for stamp, name in trial.cell.calls if stamp >= opening]
    assert [name for _, name in after if name not in ("disarm", "locate mug")][:2] == [
        "preshape cylindrical",
        "move_ptp",
    ], after
    spoken = [stamp for stamp, code in told if code == Say.YOU_HAVE_IT]
    assert len(spoken) == 1 and spoken[0] >= opening + 0.8, "after the fingers have left the object"


def test_the_wait_uses_the_share_and_time_of_the_delivery():
    """70 % of the weight, at most 5 s."""
    trial = Trial()
    entry = trial.database.get("mug")
    delivery = {**entry["deliveries"]["handle_first"], "release": {"threshold": 0.7, "timeout": 5.0}}
    trial.database.get = lambda object_id: {**entry, "deliveries": {"handle_first": delivery}}
    trial.cell.partner.take_after = None
    armed, arm = [], trial.ctx.contact.arm
    trial.ctx.contact.arm = lambda mode, limit, settings: (
        armed.append((mode, limit, settings)) or arm(mode, limit, settings)
    )

    def script(t):
        t.receive()
        t.start(GIVE)
        t.wait_hub("wait_with_object")

    trial.run(script)
    # Afterwards, the arm measures whether the person holds the object.
    assert armed[-2:] == [("release", limit, {"mass": 0.31, "load_share": 0.7}) for limit in (10.0, 16.0)]
    assert "5.0 s" in trial.ctx.journal.why()
    assert ("lift", 5.0, {"mass": 0.31, "load_share": 0.5}) in armed


def test_a_person_who_never_comes_leaves_no_warning_of_smach(monkeypatch):
    """A warning about a missing key looks like a fault of the program."""
    warned = []
    monkeypatch.setattr(smach, "logwarn", warned.append)
    trial = Trial()

    def script(t):
        t.receive()
        t.cell.faults.dead.add("perception")
        t.start(GIVE)
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "failed_holding" and warned == []
