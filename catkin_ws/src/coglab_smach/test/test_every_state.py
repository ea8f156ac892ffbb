"""What holds for every state of the hierarchy: a time limit, a way out on failure, and an end on preemption."""

import math

import pytest
from coglab_smach.states.base import CoglabState
from coglab_smach.states.hub import Fault, Hub, Stopped
from conftest import Trial


def leaves(container, path=""):
    """(path, state, its container) of every leaf below a container."""
    for label, child in container.get_children().items():
        if isinstance(child, CoglabState):
            yield f"{path}/{label}", child, container
        else:
            yield from leaves(child, f"{path}/{label}")


def test_every_state_but_those_that_wait_for_the_operator_has_a_time_limit(trial):
    found = list(leaves(trial.master))
    assert len(found) > 40
    for path, state, _ in found:
        waits = isinstance(state, Hub | Stopped | Fault)
        assert waits == math.isinf(state.time_limit()), path
        assert state.time_limit() > 0.0, path


def test_every_failure_inside_an_action_leads_to_recovery_or_out_of_its_group(trial):
    actions = ("exchange_human_to_robot", "exchange_robot_to_human", "take", "put")
    for name in actions:
        machine = trial.master.get_children()[name]
        for label in machine.get_children():
            if label == "recover":
                continue
            targets = {outcome: to for outcome, start, to in machine.get_internal_edges() if start == label}
            assert targets["failed"] == "recover", f"{name}/{label}"
            assert targets["preempted"] in ("preempted", None, "None"), f"{name}/{label}: {targets}"


def test_no_container_can_end_in_an_outcome_that_the_master_does_not_know(trial):
    labels = set(trial.master.get_children())
    for _outcome, _start, to in trial.master.get_internal_edges():
        assert str(to) in labels | {"preempted", "None"}


@pytest.mark.parametrize("moment", [0.05, 0.4, 0.9, 1.4, 1.9, 2.4, 2.9, 3.4, 4.0, 5.0])
def test_a_shut_down_ends_the_machine_at_any_moment(moment):
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.start("exchange_human_to_robot")
        t.clock.sleep(moment)
        t.asked = t.clock.now()

    trial.run(script)
    assert trial.clock.now() - trial.asked < 0.5
    assert trial.cell.called("open") == []
