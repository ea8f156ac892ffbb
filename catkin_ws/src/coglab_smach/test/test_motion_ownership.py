"""The state that starts a motion ends it: after a failure, time limit or preemption the arm stands before the next
state begins. Recovery does not move with an object that a person may hold."""

import coglab_trials.scripted.arm as model
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.kinematics.motion_time import ptp_time, read_limits
from coglab_smach.ports.pending import PortError
from coglab_smach.states import weight
from conftest import Trial
from motion_watch import MotionWatch

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"


def watched(script, prepare=lambda t: None, **overrides):
    """Run a script with a watch on the arm; returns the trial."""
    trial = Trial(**overrides)
    prepare(trial)
    watch = MotionWatch(trial.ctx, lambda: trial.cell.arm.velocity())
    over = []

    def look():
        while not over:
            watch.look()
            trial.clock.sleep(0.005)

    def scripted(t):
        t.clock.start_thread(look, "watch")
        try:
            script(t)
        finally:
            over.append(True)

    trial.run(scripted)
    assert watch.failures > 0 and watch.moved == []
    return trial


def test_a_motion_beyond_its_time_limit_is_ended_before_recovery_begins(monkeypatch):
    def script(t):
        t.wait_hub("wait_without_object")
        monkeypatch.setattr(model, "ptp_time", lambda *a: 10.0 * ptp_time(*a))
        t.start("take")
        t.wait_hub("fault", 200.0)  # recovery cannot reach home within its limit either
        assert t.cell.arm.standing().ok

    trial = watched(script)
    assert "'board'" in trial.result().reason
    assert trial.result().code == ReasonCode.TIME_LIMIT
    assert len(trial.cell.called("cancel")) >= 2


@pytest.mark.parametrize("action, moment", [("take", 0.3), ("take", 1.2), (RECEIVE, 0.3), (RECEIVE, 0.7)])
def test_a_shut_down_leaves_no_motion_behind(action, moment):
    def script(t):
        t.begin(action)
        t.clock.sleep(moment)
        assert not t.cell.arm.standing().ok
        t.master.request_preempt()
        t.clock.sleep(0.3)
        assert t.cell.arm.standing().ok

    watched(script)


def test_a_sibling_that_fails_ends_the_reach_of_the_other():
    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.faults.refuse["preshape cylindrical"] = PortError("motor 2 is stuck", code=ReasonCode.HAND_STALLED)
        t.start(RECEIVE)
        t.wait_hub("wait_without_object")

    trial = watched(script)
    assert trial.result().code == ReasonCode.HAND_STALLED
    assert trial.cell.called("cancel")


def test_the_arm_is_held_if_cancelling_fails():
    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.faults.refuse["cancel"] = "no such service"
        t.cell.faults.abort_dmp_after = 0.0
        t.cell.partner.touch_after = None
        t.cell.faults.refuse["preshape cylindrical"] = "motor 2 is stuck"
        t.start(RECEIVE)
        t.wait_hub("stopped")
        assert t.cell.arm.held and t.cell.arm.standing().ok
        t.cell.faults.refuse.clear()
        t.start("reset", "")
        t.wait_hub("wait_without_object")

    watched(script)


def test_no_state_follows_a_preemption_after_the_last_check():
    """The request arrives while the state returns its success; the next state would start the arm."""
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        switch = t.master
        for label in (RECEIVE, "approach", "arm_motion", "switch_to_dmp"):
            switch = switch.get_children()[label]
        work = switch.run

        def run(ud):
            outcome = work(ud)
            t.master.request_preempt()
            return outcome

        switch.run = run
        t.start(RECEIVE)
        t.clock.sleep(3.0)

    trial.run(script)
    assert trial.cell.called("execute_dmp") == []
    ended = {r.from_state: r.outcome for r in trial.ctx.journal.transitions}
    assert ended["switch_to_dmp"] == "preempted"


def test_an_unserved_preemption_does_not_end_the_next_handover():
    """A sibling's failure preempts the arm's machine at the moment when that machine fails itself."""
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        arm_motion = t.master
        for label in (RECEIVE, "approach", "arm_motion"):
            arm_motion = arm_motion.get_children()[label]
        state = arm_motion.get_children()["execute_dmp"]
        work = state.run

        def run(_ud):
            state.run = work
            arm_motion.request_preempt()
            raise PortError("the primitive was refused")

        state.run = run
        t.start(RECEIVE)
        t.wait_hub("wait_without_object")
        assert "the primitive was refused" in t.result().reason
        t.start(RECEIVE)
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "succeeded"


def test_a_time_limit_follows_speed_limits_and_speed_scale():
    t1 = read_limits({"joint_limits_profile": "t1"})

    def prepare(t):
        t.cell.arm.limits = t1
        t.cell.arm.scale = 0.5

    trial = Trial()
    prepare(trial)

    def script(t):
        t.wait_hub("wait_without_object", 300.0)
        for action, hub in (
            ("take", "wait_with_object"),
            ("put", "wait_without_object"),
            (RECEIVE, "wait_with_object"),
            (GIVE, "wait_without_object"),
        ):
            t.start(action)
            t.wait_hub(hub, 400.0)
            assert t.result().outcome == "succeeded", t.ctx.journal.why()

    trial.run(script)


def test_a_time_limit_follows_the_duration_of_the_primitive(monkeypatch):
    """The longest duration that an object's file allows."""
    trial = Trial()
    entry = trial.database.get("mug")
    slow = {**entry, "dmp": {**entry["dmp"], "dmp_ratio": 10.0}}
    monkeypatch.setattr(trial.database, "get", lambda object_id: slow)

    def script(t):
        t.wait_hub("wait_without_object")
        for action, hub in (("take", "wait_with_object"), ("put", "wait_without_object")):
            begin = t.clock.now()
            t.start(action)
            t.wait_hub(hub, 200.0)
            assert t.result().outcome == "succeeded", t.ctx.journal.why()
            assert t.clock.now() - begin > 10.0 * t.cell.arm.reach_time

    trial.run(script)


@pytest.mark.parametrize("hub_after", ["stopped"])
def test_the_arm_stays_if_the_person_holds_on_and_the_hand_does_not_open(hub_after, monkeypatch):
    """The arm must not move away with the person's object."""
    monkeypatch.setattr(weight, "from_palm", lambda state, track, *_: 0.0)  # always at the object

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.let_go_after = None
        t.cell.faults.refuse["open"] = PortError("motors 2, 3 are stuck", code=ReasonCode.HAND_STALLED)
        t.start(RECEIVE)
        t.wait_hub(hub_after)
        place, moved = t.cell.joints, t.cell.called("move")
        t.clock.sleep(5.0)
        assert t.cell.joints == place and t.cell.called("move") == moved
        why = t.ctx.journal.why()
        assert "motors 2, 3 are stuck" in why and t.ctx.journal.newest_failure().code == ReasonCode.NOT_RELEASED
        assert "free the object" in why and t.ctx.requests.allowed() == ("reset",)
        t.start("reset", "")
        t.wait_hub("stopped")  # still stuck: the arm stays
        assert t.cell.joints == place
        t.cell.faults.refuse.clear()
        t.clock.sleep(0.5)
        t.start("reset", "")
        t.wait_hub("wait_without_object")

    trial = watched(script)
    assert trial.result().code == ReasonCode.NOT_RELEASED


def test_the_arm_stays_if_the_hand_does_not_open_after_the_load_was_taken():
    def script(t):
        t.receive()
        t.cell.faults.refuse |= {"open": "motors 2, 3 are stuck", "preshape cylindrical": "motors 2, 3 are stuck"}
        t.start(GIVE)
        t.until(lambda: t.ctx.journal.marked("opening"))
        place = t.cell.joints
        t.wait_hub("stopped")
        t.clock.sleep(3.0)
        assert t.cell.joints == place and t.ctx.journal.newest_failure().code == ReasonCode.NOT_RELEASED
        # The operator has looked: only the robot holds the object.
        t.start("reset", "")
        t.wait_hub("wait_with_object")

    watched(script)


def test_a_failed_monitor_is_not_recorded_as_a_failure():
    trial = Trial()

    def broken():
        raise RuntimeError("no estimate")

    trial.ctx.perception.recognition = broken

    trial.run(Trial.receive)
    result = trial.result()
    assert (result.outcome, result.reason, result.code) == ("succeeded", "", 0)
    assert any(
        r.from_state == "monitor_dmp" and r.outcome == "failed" and "no estimate" in r.reason
        for r in trial.ctx.journal.transitions
    )
    assert trial.ctx.journal.newest_failure().sentence == ""
