"""The order of the states is that of D4.10 (section 3.2, Figures 3 to 8), checked in the journal. Every state has a
time limit, a transition on failure, and an end on preemption."""

import math

import pytest
from coglab_smach.states.base import CoglabState
from coglab_smach.states.hub import Fault, Hub, Stopped
from conftest import Trial


def test_init_loads_configures_and_only_then_calibrates_and_homes(trial):
    trial.run(lambda t: t.wait_hub("wait_without_object"))
    assert trial.labels("/coglab_init_robot") == [
        "load_controllers",
        "load_dmps",
        "configure_lwr",
        "wait_trigger",
        "calibrate_and_home",
    ]
    assert set(trial.labels("/coglab_init_system")) == {"coglab_init_vision", "coglab_init_robot"}
    assert trial.cell.called("load_controller") == ["load_controller"] * 2
    assert trial.cell.loaded == {"dmp": "coglab/DmpController", "ptp": "coglab/PtpController"}


def test_calibration_and_home_run_concurrently(trial):
    trial.run(lambda t: t.wait_hub("wait_without_object"))
    times = {what: when for when, what in trial.cell.calls}
    assert abs(times["calibrate fast"] - times["move_ptp"]) < 0.1


def test_init_waits_for_the_trigger_before_anything_moves():
    trial = Trial(auto_trigger=False)

    def script(t):
        t.wait_hub("wait_trigger")
        t.clock.sleep(5.0)
        assert not t.cell.called("move_ptp") and not t.cell.called("calibrate")
        t.start("initialise")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.cell.called("move_ptp")


def test_human_to_robot_order(trial):
    trial.run(Trial.receive)
    assert trial.labels("/exchange_human_to_robot") == [
        "query_database",
        "set_dmp_goal",
        "approach",
        "switch_to_ptp",
        "hand_close",
        "take_weight",
        "hand_tighten",
        "coglab_home_robot",
        "tighten_at_home",
    ]
    assert trial.labels("/approach/arm_motion") == ["switch_to_dmp", "execute_dmp", "wait_stop"]
    order = trial.cell.called()
    for earlier, later in (
        ("get mug", "locate mug"),
        ("locate mug", "switch dmp"),
        ("switch dmp", "execute_dmp"),
        ("execute_dmp", "arm contact_in_motion"),
        ("arm contact_in_motion", "close"),
        ("close", "arm lift"),
    ):
        assert order.index(earlier) < order.index(later)
    # The switch to point-to-point, which ends the DMP, comes between contact and closing.
    assert "switch ptp" in order[order.index("arm contact_in_motion") : order.index("close")]
    assert order.index("close") < len(order) - 1 - order[::-1].index("move_ptp")
    assert trial.ctx.holding == "mug"
    assert trial.result().outcome == "succeeded"


def test_preshape_runs_while_the_arm_moves(trial):
    trial.run(Trial.receive)
    marks = trial.result().marks
    assert marks["motion_started"] < marks["preshaped"] < marks["motion_reached"]
    starts = {what: when for when, what in trial.cell.calls}
    assert abs(starts["preshape cylindrical"] - starts["switch dmp"]) <= 0.02


def test_contact_is_armed_only_after_the_motion_has_ended(trial):
    trial.run(Trial.receive)
    assert not trial.ctx.contact.armed_while_moving
    marks = trial.result().marks
    assert marks["motion_reached"] <= marks["contact"]


def test_monitor_switches_the_primitive_once():
    trial = Trial(**{"monitor.primitives": {"mid": "reach_human", "high": "reach_human_high"}})
    trial.cell.partner.pattern, trial.cell.partner.pattern_at = "high", 0.4
    trial.run(Trial.receive)
    assert trial.cell.called("switch_dmp") == ["switch_dmp reach_human_high"]
    assert any(t.outcome == "switched" for t in trial.ctx.journal.transitions)


def test_monitor_leaves_the_primitive_of_giving_alone():
    trial = Trial(**{"monitor.primitives": {"mid": "reach_human", "high": "reach_human_high"}})

    def script(t):
        t.receive()
        t.cell.calls.clear()
        t.cell.partner.pattern, t.cell.partner.pattern_at = "high", 0.4
        t.start("exchange_robot_to_human")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.cell.called("execute_dmp") and trial.cell.called("switch_dmp") == []


def test_robot_to_human_order_without_a_new_query(trial):
    def script(t):
        t.receive()
        t.cell.calls.clear()
        t.start("exchange_robot_to_human")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.labels("/exchange_robot_to_human") == [
        "set_dmp_goal",
        "approach",
        "switch_to_ptp",
        "give_load",
        "hand_open",
        "coglab_home_robot",
        "open_at_home",
    ]
    assert not trial.cell.called("get")
    order = trial.cell.called()
    opened = order.index("preshape cylindrical")
    assert "switch ptp" in order[order.index("arm release") : opened]
    assert trial.ctx.holding == ""


def test_take_order_with_preshape_before(trial):
    def script(t):
        t.begin("take")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.labels("/take") == [
        "query_database",
        "approach_board",
        "set_dmp_goal",
        "hand_preshape",
        "precise_motion",
        "switch_to_ptp",
        "hand_close",
        "leave_board",
        "coglab_home_robot",
    ]
    assert set(trial.labels("/approach_board")) == {"locate_object", "move_to_board"}
    goal = trial.master.get_children()["take"].userdata.goal
    # Goal in the board frame: the seen object, its grasp, 12 mm of clearance.
    assert goal["frame"] == "board"
    assert goal["offset"] == pytest.approx([0.78 - 0.45, 0.03 + 0.55 - 0.04 - 0.012, 0.43 - 0.05 + 0.07])


def test_take_with_preshape_during_the_precise_motion():
    trial = Trial(**{"take.preshape": "during"})

    def script(t):
        t.begin("take")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert "hand_preshape" not in trial.labels("/take")
    assert "hand_preshape" in trial.labels("/take/precise_motion")


def test_put_requests_free_places_while_moving(trial):
    def script(t):
        t.receive()
        t.start("put")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.labels("/put") == [
        "approach_board",
        "set_dmp_goal",
        "precise_motion",
        "switch_to_ptp",
        "hand_open",
        "leave_board",
        "coglab_home_robot",
    ]
    times = {what: when for when, what in trial.cell.calls}
    assert "free_places" in times
    assert trial.master.get_children()["put"].userdata.goal["frame"] == "board"


def leaves(container, path=""):
    """(path, state, its container) of every leaf below a container."""
    for label, child in container.get_children().items():
        if isinstance(child, CoglabState):
            yield f"{path}/{label}", child, container
        else:
            yield from leaves(child, f"{path}/{label}")


def test_only_states_that_wait_for_the_operator_have_no_time_limit(trial):
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


@pytest.mark.parametrize("moment", [0.05, 0.4, 0.9, 1.4, 1.9, 2.4, 2.9, 3.4, 4.0, 5.0])
def test_a_shut_down_ends_the_machine_at_any_moment(moment):
    trial = Trial()

    def script(t):
        t.begin()
        t.clock.sleep(moment)
        t.asked = t.clock.now()

    trial.run(script)
    assert trial.clock.now() - trial.asked < 0.5
    assert trial.cell.called("open") == []
