"""Bad input: a node's error reaches the operator with its code, and the death of a node drops no object.

Tests of the nodes check the sentences themselves."""

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.pending import PortError
from conftest import Trial

EXCHANGE = "exchange_human_to_robot"
WORDS = "an invented sentence of a node 4711"


def goal_lost(t):
    t.cell.faults.abort_dmp_after, t.cell.faults.abort_reason = 0.6, WORDS


def two_people(t):
    t.cell.faults.refuse["locate mug"] = PortError(WORDS, code=ReasonCode.NOT_PERCEIVED)


def database_refuses(t):
    t.cell.faults.refuse["get mug"] = PortError(WORDS, code=ReasonCode.OBJECT_UNKNOWN)


def hand_refuses(t):
    t.cell.faults.refuse["preshape cylindrical"] = PortError(WORDS, code=ReasonCode.HAND_STALLED)


PASSED_ON = {
    goal_lost: ReasonCode.GOAL_LOST,
    two_people: ReasonCode.NOT_PERCEIVED,
    database_refuses: ReasonCode.OBJECT_UNKNOWN,
    hand_refuses: ReasonCode.HAND_STALLED,
}


@pytest.mark.parametrize("prepare", PASSED_ON, ids=lambda f: f.__name__)
def test_the_error_of_a_node_reaches_the_operator_unchanged_with_its_code(prepare):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        prepare(t)
        t.start(EXCHANGE)
        t.wait_hub("wait_without_object")

    trial.run(script)
    result = trial.result()
    assert result.outcome == "failed_empty" and result.code == PASSED_ON[prepare]
    assert WORDS in trial.ctx.journal.why(), trial.ctx.journal.why()
    assert WORDS in " ".join([result.reason, *result.causes])
    assert list(trial.cell.joints) == trial.ctx.config.get("postures.home")


@pytest.mark.parametrize(
    "moment, hub, state, limit, code",
    [
        (0.3, "wait_without_object", "hand_preshape", "6.0 s", ReasonCode.TIME_LIMIT),
        (2.6, "stopped", "hand_close", "11.9 s", ReasonCode.NOT_RELEASED),
    ],
)
def test_hand_node_dies_during_the_exchange(moment, hub, state, limit, code):
    trial = Trial()

    def script(t):
        t.begin()
        t.clock.sleep(moment)
        t.cell.faults.dead.add("hand")
        t.wait_hub(hub)

    trial.run(script)
    result = trial.result()
    assert (result.outcome, result.code) == ("failed_empty" if hub == "wait_without_object" else "stopped", code)
    first = [result.reason, *result.causes][-1]
    assert first.startswith(state) and limit in first
    assert "open" not in [c for c in trial.cell.called() if c == "open"][1:]


@pytest.mark.parametrize("action", [EXCHANGE, "take"])
def test_a_hand_node_that_dies_after_closing_does_not_count_as_empty(action):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        # Until it dies, the hand reports that it is empty, and the brain waits for a grip.
        t.cell.faults.empty_grasp = True
        t.start(action)
        t.until(lambda: t.ctx.journal.marked("closed"))
        t.cell.calls.clear()
        t.clock.sleep(0.1)
        t.cell.faults.dead.add("hand")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.ctx.holding == "mug" and "missed" not in trial.result().marks
    assert not trial.cell.called("open") and not trial.cell.called("preshape"), "an object in the hand would fall"


def stale(frame, age):
    """A refusal of execute_dmp. Only its code has a meaning."""
    return PortError(f"frame '{frame}': age {age:.2f}, too much", code=ReasonCode.GOAL_STALE)


def test_the_start_waits_for_a_goal_that_is_lost_for_a_moment():
    trial = Trial()
    trial.cell.faults.refuse["execute_dmp"] = stale("object_mug", 0.45)

    def script(t):
        t.begin()
        while not t.cell.called("execute_dmp"):
            t.clock.sleep(0.02)
        t.clock.sleep(0.4)
        del t.cell.faults.refuse["execute_dmp"]
        t.wait_hub("wait_with_object")
        t.cell.faults.refuse["execute_dmp"] = stale("human_hand", 3.10)
        t.start("exchange_robot_to_human")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert [r.outcome for r in trial.ctx.journal.results[1:]] == ["succeeded", "failed_holding"]
    assert "age 3.10" in trial.ctx.journal.why()
