"""The action coglab/handover on scripted ports in virtual time: results, rejections and cancelling."""

import pytest
import rospy
from coglab_msgs.msg import HandoverGoal, ReasonCode
from coglab_smach.ros.handover_server import HandoverServer
from conftest import Trial


class Handle:
    """A goal handle like that of the action server. ``state``: its last state."""

    def __init__(self, **fields):
        self.goal = HandoverGoal(**fields)
        self.state, self.result, self.feedback = "pending", None, []

    def get_goal(self):
        return self.goal

    def set_accepted(self, text):
        self.state = "active"

    def publish_feedback(self, feedback):
        self.feedback.append(feedback)

    def _end(self, state, result):
        assert self.result is None, "ended twice"
        self.state, self.result = state, result

    def set_rejected(self, result, text):
        self._end("rejected", result)

    def set_canceled(self, result, text):
        self._end("canceled", result)

    def set_aborted(self, result, text):
        self._end("aborted", result)

    def set_succeeded(self, result, text):
        self._end("succeeded", result)


class Served(Trial):
    """A master with the action server."""

    def __init__(self, **overrides):
        super().__init__(**overrides)
        ctx = self.ctx

        def stop(reason):
            ctx.stop.press(reason)
            ctx.arm.hold(reason)

        self.server = HandoverServer(
            ctx,
            stop,
            lambda s: rospy.Time.from_sec(1000.0 + s),
            lambda s: f"{s:.3f}Z",
            lambda function: self.clock.start_thread(function, "handover"),
        )
        self.published = []
        ctx.journal.listen_results(lambda record: self.published.append(self.server.result_of(record)))

    def send(self, action, object_id="", **fields):
        """Send a goal as a client would."""
        handle = Handle(action=action, object_id=object_id, **fields)
        self.server.on_goal(handle)
        return handle

    def end_of(self, handle, limit=100.0):
        """Wait until the goal has ended. Returns its state and its result."""
        self.until(lambda: handle.result is not None, limit)
        return handle.state, handle.result


def test_a_goal_publishes_its_phases_and_has_a_typed_result():
    trial = Served()

    def script(t):
        receive = t.send("receive", "mug", participant="P03", condition="calm", wait=30.0)  # before the hub is open
        state, result = t.end_of(receive)
        assert (state, result.success, result.outcome, result.reason_code) == ("succeeded", True, "succeeded", 0)
        assert (result.action, result.object_id, result.holding) == ("exchange_human_to_robot", "mug", "mug")
        assert (result.participant, result.condition, result.delivery) == ("P03", "calm", "")
        assert result.duration == pytest.approx((result.ended - result.started).to_sec(), abs=1e-6)
        marks = {mark.name: mark.stamp for mark in result.marks}
        assert {"offered", "contact"} <= set(marks) and list(marks.values()) == sorted(marks.values())
        assert all(result.started <= when <= result.ended for when in marks.values())
        assert result == t.published[-1] and result.id.endswith("_exchange_human_to_robot")
        phases = [feedback.phase for feedback in receive.feedback]
        assert any(phase.endswith("exchange_human_to_robot/take_weight") for phase in phases)
        assert any(f.reason_code == ReasonCode.WAITS_FOR_CONTACT and 0.0 < f.left < 30.0 for f in receive.feedback)
        assert [f.elapsed for f in receive.feedback] == sorted(f.elapsed for f in receive.feedback)
        state, result = t.end_of(t.send("give", delivery="rim_first"))  # the hub is open already
        assert (state, result.delivery, result.holding) == ("succeeded", "rim_first", "")
        assert t.ctx.requests.hub() == "wait_without_object"

    trial.run(script)


def test_a_second_goal_is_rejected_and_does_not_disturb_the_first():
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        first = t.send("receive", "mug")
        t.until(lambda: first.state == "active")
        state, result = t.end_of(t.send("give"))
        assert (state, result.outcome, result.reason_code) == ("rejected", "refused", ReasonCode.BUSY)
        assert "'receive'" in result.reason
        t.server.on_cancel(Handle())  # not the running goal
        assert t.end_of(first)[0] == "succeeded"

    trial.run(script)


@pytest.mark.parametrize(
    ("fields", "code", "said"),
    [
        ({"action": "give", "wait": 3.0}, ReasonCode.WRONG_STATE, "wait_without_object"),
        ({"action": "juggle", "wait": 9.0}, ReasonCode.UNKNOWN_NAME, "receive, give"),
        ({"action": ""}, ReasonCode.INVALID_ARGUMENT, "action"),
        ({"action": "take", "object_id": "elephant", "wait": 9.0}, ReasonCode.OBJECT_UNKNOWN, "elephant"),
        ({"action": "take", "wait": float("nan")}, ReasonCode.OUT_OF_RANGE, "nan"),
        ({"action": "take", "condition": "x" * 65}, ReasonCode.OUT_OF_RANGE, "condition"),
        ({"action": "take", "delivery": "rim_first"}, ReasonCode.INVALID_ARGUMENT, "rim_first"),
    ],
)
def test_an_invalid_goal_is_rejected_with_a_reason_and_nothing_moves(fields, code, said):
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        calls, begun = len(t.cell.called("move_ptp")), t.clock.now()
        state, result = t.end_of(t.send(**fields))
        waited = t.clock.now() - begun
        assert (state, result.reason_code) == ("rejected", code) and said in result.reason
        assert (3.0 <= waited < 3.2) if fields.get("wait") == 3.0 else waited < 0.5
        assert len(t.cell.called("move_ptp")) == calls and t.ctx.requests.hub() == "wait_without_object"

    trial.run(script)


def test_cancel_is_stop_and_the_same_action_can_request_reset():
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        goal = t.send("receive", "mug")
        t.until(lambda: any(f.phase.endswith("/execute_dmp") or "arm_motion" in f.phase for f in goal.feedback))
        t.server.on_cancel(goal)
        t.server.on_cancel(goal)
        state, result = t.end_of(goal)
        assert (state, result.outcome, result.reason_code) == ("canceled", "stopped", ReasonCode.STOP_LATCHED)
        assert t.ctx.arm.standing().ok and t.ctx.stop.pressed() and t.ctx.requests.hub() == "stopped"
        state, result = t.end_of(t.send("receive", "mug"))
        assert (state, result.reason_code) == ("rejected", ReasonCode.WRONG_STATE)
        state, result = t.end_of(t.send("reset"))
        assert (state, result.outcome) == ("succeeded", "succeeded") and t.ctx.requests.hub() == "wait_without_object"
        assert t.end_of(t.send("receive", "mug"))[0] == "succeeded"

    trial.run(script)


def test_a_cancel_before_the_action_has_begun_stops_nothing():
    trial = Served(auto_trigger=False)

    def script(t):
        t.wait_hub("wait_trigger")
        goal = t.send("receive", "mug", wait=100.0)
        t.clock.sleep(1.0)
        t.server.on_cancel(goal)
        state, result = t.end_of(goal, 1.0)
        assert (state, result.outcome, result.reason_code) == ("canceled", "refused", ReasonCode.CANCELLED)
        assert not t.ctx.stop.pressed()
        state, result = t.end_of(t.send("initialise"))
        assert (state, t.ctx.requests.hub()) == ("succeeded", "wait_without_object")

    trial.run(script)


def test_after_its_time_limit_the_action_is_stopped():
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.touch_after = None  # nobody ever touches the hand
        begun = t.clock.now()
        state, result = t.end_of(t.send("receive", "mug", time_limit=2.0))
        assert (state, result.outcome, result.reason_code) == ("aborted", "stopped", ReasonCode.TIME_LIMIT)
        assert "2 s" in result.reason and t.clock.now() - begun < 4.0

    trial.run(script)


def test_the_action_of_a_dead_client_ends_by_itself():
    """Without its client the goal runs to its end and nothing follows. The next client is served."""
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        lost = t.send("receive", "mug")
        t.wait_hub("wait_with_object")
        moved = len(t.cell.called())
        t.clock.sleep(20.0)
        assert t.cell.called()[moved:] == [] and lost.result.success
        assert t.end_of(t.send("put"))[0] == "succeeded"

    trial.run(script)


def test_an_accepted_action_that_the_hub_drops_has_a_result():
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        take = t.ctx.requests.take
        t.ctx.requests.take = lambda: None  # the hub does not look before it is stopped
        goal = t.send("receive", "mug")
        t.until(lambda: goal.state == "active")
        t.ctx.stop.press("somebody pressed STOP")
        t.wait_hub("stopped")
        t.ctx.requests.take = take
        state, result = t.end_of(goal, 5.0)
        assert (state, result.outcome, result.reason_code) == ("aborted", "stopped", ReasonCode.STOP_LATCHED)
        assert "somebody pressed STOP" in result.reason

    trial.run(script)


def test_the_result_of_an_action_without_a_goal_has_no_labels():
    trial = Served()

    def script(t):
        t.wait_hub("wait_without_object")
        waiting = t.send("give", participant="P1", wait=60.0)  # waits for the hub with an object
        t.start("take")
        t.until(lambda: any(result.action == "take" for result in t.published))
        took = next(result for result in t.published if result.action == "take")
        assert took.success and took.participant == ""
        assert t.end_of(waiting)[1].participant == "P1"

    trial.run(script)
