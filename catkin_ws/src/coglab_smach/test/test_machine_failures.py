"""After any failure the machine ends in a hub, in 'stopped' or in 'fault', with a reason. It is never stuck and never
drops the object."""

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.states import weight
from conftest import Trial

WORDS, CAUSE = "an invented sentence of a node 4712", "an invented cause 4713"


def failed_exchange(prepare, hub="wait_without_object", action="exchange_human_to_robot", object_id="mug", **overrides):
    """Run one exchange that is made to fail; returns the trial."""
    trial = Trial(**overrides)

    def script(t):
        t.wait_hub("wait_without_object")
        prepare(t)
        t.start(action, object_id)
        t.wait_hub(hub)

    return trial.run(script)


def assert_recovered_empty(trial, word):
    result = trial.result()
    assert result.outcome == "failed_empty" and word in result.reason + " ".join(result.causes), result.reason
    calls = trial.cell.called()
    assert "open" in calls and calls[-1] != "execute_dmp" and trial.ctx.holding == ""
    assert trial.cell.arm.active == "ptp" and list(trial.cell.joints) == trial.ctx.config.get("postures.home")


FAILURES = {
    "an object that is not in the database": (
        lambda t: None,
        ReasonCode.OBJECT_UNKNOWN,
        "'elephant'",
    ),
    "an object that is not seen": (lambda t: t.cell.faults.not_seen.add("mug"), ReasonCode.OBJECT_NOT_SEEN, "mug"),
    "nobody offers it": (
        lambda t: t.cell.objects.update(mug=Pose([1.2, 0.2, 0.1])),
        ReasonCode.OBJECT_NOT_SEEN,
        "8 s",
    ),
    "nobody touches": (lambda t: setattr(t.cell.partner, "touch_after", None), ReasonCode.NO_CONTACT, "contact"),
    "no contact detector": (lambda t: t.cell.faults.dead.add("contact"), ReasonCode.TIME_LIMIT, "2.0 s"),
    "no database": (lambda t: t.cell.faults.dead.add("database"), ReasonCode.TIME_LIMIT, "'mug'"),
    "an empty hand": (lambda t: setattr(t.cell.faults, "empty_grasp", True), ReasonCode.OBJECT_NOT_SEEN, "hand_close"),
    "a programming error": (lambda t: setattr(t.ctx.database, "get_object", None), ReasonCode.UNEXPECTED, "TypeError"),
}
"""preparation, code of the result, part of its reason"""


@pytest.mark.parametrize("prepare, code, word", FAILURES.values(), ids=FAILURES)
def test_a_failure_ends_at_home_with_an_empty_hand_and_its_reason(prepare, code, word):
    trial = failed_exchange(prepare, object_id="elephant" if code == ReasonCode.OBJECT_UNKNOWN else "mug")
    assert_recovered_empty(trial, word)
    assert trial.result().code == code, trial.result()
    assert all(t.reason for t in trial.ctx.journal.transitions if t.outcome in ("failed", "failed_empty"))
    if word == "8 s":
        assert "execute_dmp" not in trial.cell.called(), "the arm has not moved"


def test_the_arm_does_not_follow_an_offer_withdrawn_before_its_start():
    """The offer must last for ``start_after``. A withdrawn offer starts nothing; a second one does."""
    trial = Trial(**{"handover.start_after": 1.0})

    def script(t):
        t.wait_hub("wait_without_object")
        offered = t.cell.objects["mug"]
        t.start("exchange_human_to_robot")
        t.until(lambda: t.ctx.journal.marked("offered"))
        t.clock.sleep(0.5)
        t.cell.objects["mug"] = Pose([1.2, 0.2, 0.1])
        t.clock.sleep(3.0)
        assert "execute_dmp" not in t.cell.called()
        t.cell.objects["mug"] = offered
        t.clock.sleep(0.9)
        assert "execute_dmp" not in t.cell.called()
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "succeeded"


def test_a_person_who_does_not_let_go_gets_the_object_back(monkeypatch):
    monkeypatch.setattr(weight, "from_palm", lambda state, track, *_: 0.1)
    trial = failed_exchange(lambda t: setattr(t.cell.partner, "let_go_after", None))
    assert_recovered_empty(trial, "'mug'")
    assert trial.result().code == ReasonCode.NOT_RELEASED


def test_a_carried_object_is_not_dropped_when_the_person_disappears():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.let_go = lambda: t.cell.faults.not_seen.add("human_hand")
        t.start("exchange_human_to_robot")
        t.wait_hub("stopped")
        assert t.cell.called("open") == [] and t.ctx.holding == "mug"
        assert "not seen" in t.ctx.journal.why()
        # The operator has looked: only the robot holds the object.
        t.start("reset", "")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().code == ReasonCode.NOT_RELEASED


def test_an_object_is_kept_when_the_person_disappears_without_measured_weight():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.let_go_after = None
        while "arm lift" not in t.cell.called():
            if not t.begun_once:
                t.start("exchange_human_to_robot")
                t.begun_once = True
            t.clock.sleep(0.05)
        t.cell.faults.not_seen.add("human_hand")
        t.wait_hub("stopped")
        assert t.cell.called("open") == [] and t.ctx.holding == "mug"
        assert "not seen" in t.ctx.journal.why()

    trial.begun_once = False
    trial.run(script)
    assert trial.result().code == ReasonCode.NOT_RELEASED


def test_dead_arm_node_ends_in_fault_and_can_be_initialised_again():
    trial = Trial()

    def script(t):
        t.begin()
        t.clock.sleep(1.0)
        t.cell.faults.dead.add("arm")
        t.wait_hub("fault")
        assert t.ctx.journal.newest_failure().code == ReasonCode.NODE_SILENT
        t.cell.faults.dead.clear()
        t.start("initialise")
        t.wait_hub("wait_without_object")

    trial.run(script)


def test_failed_start_up_ends_in_fault_with_the_reason():
    trial = Trial()
    trial.cell.faults.refuse["load_dmps"] = "library.xml:3: <weights> has 14 numbers, expected 15"

    def script(t):
        t.wait_hub("fault")
        assert "library.xml:3" in t.ctx.journal.why()
        del t.cell.faults.refuse["load_dmps"]
        t.start("initialise")
        t.wait_hub("wait_without_object")

    trial.run(script)


def test_the_start_is_repeated_for_a_late_robot_controller():
    trial = Trial()
    trial.cell.faults.refuse["lwr start"] = "no datagrams from the robot controller"

    def script(t):
        t.clock.sleep(8.0)
        del t.cell.faults.refuse["lwr start"]
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert len(trial.cell.called("lwr start")) > 3


@pytest.mark.parametrize("moment", [0.2, 0.9, 1.8, 2.5, 3.4, 4.5])
def test_stop_holds_never_opens_the_hand_and_needs_a_reset(moment):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.calls.clear()
        t.start("exchange_human_to_robot")
        t.clock.sleep(moment)
        t.ctx.stop.press("the operator pressed STOP")
        t.ctx.arm.hold("STOP")
        t.wait_hub("stopped", limit=1.0)
        assert "open" not in t.cell.called()
        held = t.ctx.hand.state().holding
        before = len(t.cell.called())
        t.clock.sleep(3.0)
        assert len(t.cell.called()) == before, "something moved after STOP"
        t.start("reset", "")
        t.wait_hub("wait_with_object" if held else "wait_without_object")

    trial.run(script)
    assert trial.ctx.journal.results[-1].code == ReasonCode.STOP_LATCHED


def test_a_request_for_another_object_uses_the_held_one(trial):
    def script(t):
        t.receive()
        t.start("put", "bottle")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert any("'bottle'" in t.reason and "'mug'" in t.reason for t in trial.ctx.journal.transitions)


def test_no_free_place_keeps_the_object():
    trial = Trial()

    def script(t):
        t.receive()
        t.ctx.perception.places = []
        t.start("put")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "failed_holding" and trial.result().code == ReasonCode.NO_FREE_PLACE
