"""coglab/state and coglab/why follow the machine; an impossible start is refused at once with its reason."""

import json
import math

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.context.journal import Journal, Wait
from coglab_smach.context.master_state import StateWatch
from coglab_smach.context.requests import TriggerReply, ask_for
from coglab_smach.ports.pending import PortError
from conftest import Trial

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"


class Watched(Trial):
    """A trial that collects all published states."""

    def __init__(self, **overrides):
        super().__init__(**overrides)
        self.shown = []
        self.watch = StateWatch(self.ctx, self.shown.append)

    def ask(self, action, object_id=""):
        return ask_for(self.ctx, action, object_id)


def test_the_reason_is_published_until_the_operator_acts():
    trial = Watched()

    def script(t):
        t.wait_hub("wait_without_object")
        assert t.shown[-1].why == "" and t.shown[-1].actions == (RECEIVE, "take")
        t.cell.arm.held = True
        t.wait_hub("stopped")
        stopped = t.shown[-1]
        assert stopped.state == "/coglab_master/stopped" and stopped.in_hub and stopped.actions == ("reset",)
        assert stopped.reason_code == ReasonCode.HELD and "hold is latched" in stopped.why
        # Somebody ends the hold directly at the robot: the machine still waits for the operator's reset.
        t.cell.arm.held = False
        t.clock.sleep(1.0)
        assert t.ctx.requests.hub() == "stopped"
        refused = t.ask("initialise")
        assert not refused.ok and refused.code == ReasonCode.WRONG_STATE
        assert "stopped takes reset" in refused.message
        assert t.ask("reset").ok
        t.wait_hub("wait_without_object")
        assert t.shown[-1].why == "" and t.shown[-1].reason_code == 0
        for action, hub in ((RECEIVE, "wait_with_object"), (GIVE, "wait_without_object")):
            assert t.ask(action, "mug").ok
            t.wait_hub(hub)
        assert t.watch.now().why == ""

    trial.run(script)
    assert all(a != b for a, b in zip(trial.shown, trial.shown[1:], strict=False))
    held = [s for s in trial.shown if s.object_id == "mug"]
    assert held and any(s.state.endswith("/approach/arm_motion/wait_stop") for s in trial.shown)


def test_waits_are_published_with_their_deadline():
    """Giving waits for the hand, the end of the reach and the taking; each wait has its time limit."""
    trial, timed = Watched(), []
    StateWatch(trial.ctx, lambda state: timed.append((trial.clock.now(), state)))

    def script(t):
        t.wait_hub("wait_without_object")
        assert (t.shown[-1].waits_for, t.shown[-1].deadline) == ("", 0.0)  # a hub has no time limit
        for action, hub in ((RECEIVE, "wait_with_object"), (GIVE, "wait_without_object")):
            assert t.ask(action, "mug").ok
            t.wait_hub(hub)
        assert t.shown[-1].waits_for == ""

    trial.run(script)
    assert all((s.deadline > 0.0) == bool(s.waits_for) == bool(s.waits_code) for s in trial.shown)
    beginning, receiving, giving = (
        {(s.state.split("/")[-1], s.waits_code) for s in trial.shown if f"/{action}/" in s.state}
        for action in ("coglab_init_system", RECEIVE, GIVE)
    )
    assert {
        ("coglab_home_robot", ReasonCode.WAITS_FOR_ARM),
        ("coglab_init_vision", ReasonCode.WAITS_FOR_SIGHT),
    } <= beginning
    assert {("set_dmp_goal", ReasonCode.WAITS_FOR_PERSON), ("wait_stop", ReasonCode.WAITS_FOR_CONTACT)} <= receiving
    assert {
        ("set_dmp_goal", ReasonCode.WAITS_FOR_PERSON),
        ("wait_stop", ReasonCode.WAITS_FOR_ARM),
        ("give_load", ReasonCode.WAITS_FOR_PERSON),
        ("hand_open", ReasonCode.WAITS_FOR_HAND),
    } <= giving
    taking = ReasonCode.WAITS_FOR_PERSON
    left = [s.deadline - t for t, s in timed if s.state.endswith("/give_load") and s.waits_code == taking]
    assert left and abs(left[0] - 8.0) < 0.05  # the limit in the mug's delivery
    # The monitor beside the motion is never shown as a wait, not even between two waits of the motion.
    assert not any("pattern" in s.waits_for for s in trial.shown)


def test_an_extended_wait_is_published_again():
    journal = Journal(lambda: 0.0)
    told = []
    journal.listen_waits(lambda: told.append(journal.wait()))
    journal.waits("/m/a", Wait("the reach", 5.0))
    journal.waits("/m/b", Wait("another pattern", math.inf))
    assert journal.wait() == Wait("the reach", 5.0)
    with journal.waiting("/m/c", Wait("the sight", 2.0)):
        assert journal.wait().what == "the sight"  # the wait with the earliest limit
    journal.waits("/m/a", Wait("the reach", 7.0))
    assert journal.wait().deadline == 7.0
    journal.waits("/m/a", None)
    assert journal.wait() == Wait() and len(told) == 6


def test_a_wait_of_a_monitor_is_published_only_if_nothing_else_runs():
    journal = Journal(lambda: 0.0)
    journal.entered("/m/monitor")
    journal.waits("/m/monitor", Wait("another pattern", 5.0, aside=True))
    assert journal.wait().what == "another pattern"
    journal.entered("/m/reach")
    assert journal.wait() == Wait()  # between two waits of the reach
    journal.waits("/m/reach", Wait("the reach", 7.0))
    assert journal.wait().what == "the reach"
    journal.waits("/m/reach", None)
    journal.left("/m/reach")
    assert journal.wait().what == "another pattern"


def test_a_failure_is_published_until_the_next_success():
    trial = Watched()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.faults.not_seen.add("mug")
        t.ask(RECEIVE, "mug")
        t.clock.sleep(0.5)
        t.wait_hub("wait_without_object")
        assert t.shown[-1].why and t.shown[-1].reason_code == ReasonCode.OBJECT_NOT_SEEN
        t.cell.faults.not_seen.clear()
        assert t.ask(RECEIVE, "mug").ok
        t.wait_hub("wait_with_object")
        assert t.shown[-1].why == ""

    trial.run(script)
    failed = trial.ctx.journal.results[1]
    assert failed.to_dict()["reason_code"] == ReasonCode.OBJECT_NOT_SEEN and json.dumps(failed.to_dict())
    codes = {r.code for r in trial.ctx.journal.transitions if r.outcome in ("failed", "failed_empty")}
    assert codes == {ReasonCode.OBJECT_NOT_SEEN}


def no_hub(t):
    t.ctx.requests.close()
    return t.ask("take", "mug")


def no_name(t):
    t.ctx.requests.open("wait_with_object", ["put"], names_object=True, default_object="")
    return t.ask("put")


def asked_twice(t):
    t.ctx.requests.open("wait_without_object", ["take"], default_object="mug")  # no hub takes the request
    assert t.ask("take", "mug").ok
    return t.ask("take", "mug")


def silent_database(t):
    t.cell.faults.dead.add("database")
    return t.ask(RECEIVE, "mug")


def broken_database(t):
    t.cell.faults.refuse["list"] = PortError("service list_objects is not there", code=ReasonCode.NODE_SILENT)
    return t.ask("take", "mug")


def held_by_the_hub(t):
    """Refused after it was accepted: meanwhile the database has lost the object."""
    t.cell.faults.refuse["get mug"] = PortError("'mug' is not in the database", code=ReasonCode.OBJECT_UNKNOWN)
    t.ctx.holding = "unknown"
    t.cell.arm.held = True
    t.wait_hub("stopped")
    t.cell.hand_positions = (200, 150, 160, 155, 170)
    assert t.ask("reset").ok
    t.wait_hub("wait_with_object")
    assert t.ask("put", "mug").ok
    t.clock.sleep(1.0)
    refused = [r for r in t.ctx.journal.transitions if r.outcome == "refused"][-1]
    return TriggerReply(False, refused.reason, refused.code)


@pytest.mark.parametrize(
    "refuse, code, words",
    [
        (no_hub, ReasonCode.WRONG_STATE, "hub"),
        (lambda t: t.ask(GIVE), ReasonCode.WRONG_STATE, "wait_without_object"),
        (no_name, ReasonCode.OBJECT_UNKNOWN, "restart"),
        (asked_twice, ReasonCode.BUSY, "'take'"),
        (silent_database, ReasonCode.NODE_SILENT, "2 s"),
        (broken_database, ReasonCode.NODE_SILENT, "list_objects"),
        (lambda t: t.ask("take", "elephant"), ReasonCode.OBJECT_UNKNOWN, "'elephant'"),
        (held_by_the_hub, ReasonCode.OBJECT_UNKNOWN, "'mug'"),
    ],
)
def test_a_refusal_has_a_reason_and_names_no_shell_command(refuse, code, words):
    trial = Watched()

    def script(t):
        t.wait_hub("wait_without_object")
        refused = refuse(t)
        assert not refused.ok and refused.code == code and words in refused.message, refused
        # Python and the console show the same sentence. A command of the shell would be wrong there.
        assert "./coglab" not in refused.message, refused

    trial.run(script)
