"""Events while a hub waits: STOP and hold are shown and reset by the operator; the held object survives a restart."""

import json

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.context.holding import HoldingMemory
from conftest import Trial

WORDS = "an invented sentence of the perception node 4714"


@pytest.mark.parametrize("with_object", [False, True])
def test_a_hold_in_a_hub_is_shown_and_needs_a_reset(with_object):
    trial = Trial()

    def script(t):
        t.receive() if with_object else t.wait_hub("wait_without_object")
        hub = t.ctx.requests.hub()
        before = len(t.cell.called())
        t.cell.arm.held = True  # somebody sent 'hold' directly to the robot
        t.wait_hub("stopped", limit=2.0)
        why = t.ctx.journal.why()
        assert t.ctx.journal.newest_failure().code == ReasonCode.HELD and "hold is latched" in why
        ok, message, _ = t.ctx.requests.submit("take", "mug")
        assert not ok and "reset" in message
        assert t.cell.called()[before:] == [], "something moved in a hub that is blocked"
        t.start("reset", "")
        t.wait_hub(hub)
        if with_object:
            assert "open" not in t.cell.called()[before:] and t.ctx.holding == "mug"

    trial.run(script)
    ended = [(r.from_state, r.outcome) for r in trial.ctx.journal.transitions if r.path == "/coglab_master"]
    assert ("wait_with_object" if with_object else "wait_without_object", "stopped") in ended


def test_command_mode_lost_in_a_hub_is_started_again_by_the_reset():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.arm.enabled = False
        t.wait_hub("stopped", limit=2.0)
        assert t.ctx.journal.newest_failure().code == ReasonCode.NOT_STARTED
        t.cell.calls.clear()
        t.start("reset", "")
        t.wait_hub("wait_without_object")
        assert t.cell.called("lwr") == ["lwr reset", "lwr start"]

    trial.run(script)


def test_a_hiccup_does_not_leave_the_hub():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.arm.held = True
        t.clock.sleep(0.3)
        t.cell.arm.held = False
        t.clock.sleep(1.0)
        assert t.ctx.requests.hub() == "wait_without_object"

    trial.run(script)


def test_a_robot_node_that_dies_in_a_hub_ends_in_fault():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.faults.dead.add("arm")
        t.wait_hub("fault", limit=5.0)
        assert t.ctx.journal.newest_failure().code == ReasonCode.NODE_SILENT
        t.cell.faults.dead.clear()
        t.start("initialise")
        t.wait_hub("wait_without_object")

    trial.run(script)


def test_a_hold_during_an_action_never_opens_the_hand():
    trial = Trial()

    def script(t):
        t.receive()
        t.cell.calls.clear()
        t.start("exchange_robot_to_human")
        t.clock.sleep(0.8)
        t.cell.arm.held = True
        t.wait_hub("stopped", limit=10.0)
        t.clock.sleep(3.0)
        assert "open" not in t.cell.called() and t.ctx.holding == "mug"
        t.start("reset", "")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "stopped" and trial.result().code == ReasonCode.HELD


def test_a_restarted_robot_node_without_plugins_ends_in_fault():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.arm.enabled = False
        t.wait_hub("stopped", limit=2.0)
        t.cell.loaded.clear()  # killed and started again: nothing is loaded any more
        t.start("reset", "")
        t.wait_hub("fault")
        assert "'ptp'" in t.ctx.journal.why()
        t.start("initialise")
        t.wait_hub("wait_without_object")

    trial.run(script)


class Restarted(Trial):
    """A brain that starts while the hand holds an object, with the note of an earlier brain on disk."""

    def __init__(self, path, **overrides):
        super().__init__(**overrides)
        self.ctx.memory = HoldingMemory(str(path))
        self.cell.hand_positions = (200, 150, 160, 155, 170)
        self.cell.arm.enabled = self.cell.calibrated = True
        self.cell.at_palm = ("mug", Pose(np.array([0.07, 0.0, 0.0])))


@pytest.fixture
def noted(tmp_path):
    path = tmp_path / "home" / "holding.json"
    HoldingMemory(str(path)).note("mug")
    return path


def test_a_restarted_brain_continues_with_the_held_object(noted):
    trial = Restarted(noted)

    def script(t):
        t.wait_hub("wait_with_object")
        assert t.ctx.holding == "mug"
        assert not t.cell.called("open") and not t.cell.called("calibrate"), "the hand was opened"
        t.start("exchange_robot_to_human", "")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.result().outcome == "succeeded" and trial.result().object_id == "mug"
    assert json.loads(noted.read_text()) == {"object_id": ""}


def test_a_restarted_brain_without_a_note_needs_the_objects_name(tmp_path):
    trial = Restarted(tmp_path / "none.json")

    def script(t):
        t.wait_hub("wait_with_object")
        ok, message, code = t.ctx.requests.submit("put", "")
        assert not ok and code == ReasonCode.OBJECT_UNKNOWN and "object_id" in message
        t.start("put", "elephant")
        t.wait_hub("wait_with_object")
        refused = [r for r in t.ctx.journal.transitions if r.outcome == "refused"][-1]
        assert refused.code == ReasonCode.OBJECT_UNKNOWN and "'elephant'" in refused.reason
        t.start("put", "mug")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.result().outcome == "succeeded" and trial.result().object_id == "mug"


def test_a_note_does_not_count_if_the_hand_is_empty(noted):
    trial = Restarted(noted)
    trial.cell.hand_positions = (0, 0, 0, 0, 0)
    trial.run(lambda t: t.wait_hub("wait_without_object"))
    assert trial.ctx.holding == ""


def test_a_removed_object_leads_to_the_hub_without_object():
    trial = Trial()

    def script(t):
        t.receive()
        t.cell.hand_positions = (200, 254, 254, 254, 254)
        t.cell.faults.empty_grasp = True
        t.ctx.stop.press("the operator pressed STOP")
        t.wait_hub("stopped")
        t.start("reset", "")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.ctx.holding == ""


def test_an_old_belief_does_not_trigger():
    trial = Trial(
        **{
            "recognition_trigger.enabled": True,
            "monitor.enabled": False,
        }
    )
    partner = trial.cell.partner

    def script(t):
        t.wait_hub("wait_without_object")
        t.clock.sleep(0.5)
        partner.offer = 0.95
        t.wait_hub("wait_with_object")
        partner.offer, partner.request = 0.0, 0.95
        t.clock.sleep(3.0)
        assert t.ctx.requests.hub() == "wait_with_object", "an old reach must not count as a new one"
        partner.request = 0.05
        t.clock.sleep(0.5)
        partner.request = 0.95
        t.wait_hub("wait_without_object")

    trial.run(script)
    asked = [r.outcome for r in trial.ctx.journal.transitions if "belief" in r.reason]
    assert asked == ["exchange_human_to_robot", "exchange_robot_to_human"]
