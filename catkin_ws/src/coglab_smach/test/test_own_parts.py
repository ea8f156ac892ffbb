"""Parts of a user's package, deliveries and the choice of the grasp: valid parts run, others are refused."""

import os
import sys
from pathlib import Path

import pytest
from coglab_msgs.msg import ReasonCode, Say
from coglab_smach.context.config import Config, ConfigError
from coglab_smach.context.parts import Parts
from coglab_smach.context.requests import ask_for
from coglab_smach.machines.board import build_take
from coglab_smach.states.base import CoglabState
from conftest import Trial

WIPE = {"wipe": {"build": "my_lab.machines:build_wipe", "hand": "holding"}}


@pytest.fixture(autouse=True)
def here(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def plain_value(ctx):
    return 3


def raises(ctx):
    return ctx.no_such_port


class OtherOutcomes(CoglabState):
    def __init__(self, ctx):
        super().__init__(ctx, outcomes=["succeeded", "maybe"])


def without_arguments():
    pass


class ReturnsNonsense(CoglabState):
    def run(self, ud):
        return "nonsense"


def no_delivery(entry, hand):
    return {"pose": {"xyz": [3, 0, 0]}, "release": {}}


def asks(t, action, object_id="", delivery=""):
    answer = ask_for(t.ctx, action, object_id, delivery=delivery)
    t.clock.sleep(0.1)
    return answer


def received(t):
    t.wait_hub("wait_without_object")
    assert asks(t, "receive", "mug").ok
    t.wait_hub("wait_with_object")


def test_a_users_action_runs_has_a_result_and_returns_to_the_hub():
    trial = Trial(actions=WIPE)

    def script(t):
        t.wait_hub("wait_without_object")
        assert asks(t, "wipe").code == ReasonCode.WRONG_STATE
        received(t)
        assert t.ctx.requests.allowed() == ("exchange_robot_to_human", "put", "wipe")
        assert asks(t, "wipe").ok
        t.wait_hub("wait_with_object")
        assert (t.result().kind, t.result().object_id, t.result().outcome) == ("wipe", "mug", "succeeded")
        assert t.labels("/wipe/strokes").count("to_board") == 3 and t.ctx.holding == "mug"

    trial.run(script)


def test_a_failure_in_a_users_action_goes_through_recovery():
    trial = Trial(actions=WIPE)

    def script(t):
        received(t)
        t.cell.faults.dead.add("arm")
        assert asks(t, "wipe").ok
        t.until(lambda: t.ctx.journal.results[-1].kind == "wipe")
        assert t.result().outcome in ("failed_holding", "fault") and t.result().code
        assert t.ctx.holding == "mug", "the hand keeps its object"

    trial.run(script)


def test_a_users_state_replaces_a_shipped_one():
    trial = Trial(states={"exchange_human_to_robot/query_database": "my_lab.states:AnnounceAndQuery"})
    said = []
    trial.ctx.say = lambda code, text: said.append(code)
    trial.run(received)
    assert Say.NOTHING in said and trial.result().outcome == "succeeded"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"actions": {"wipe": "my_labb.machines:build"}}, "actions.wipe: .*'my_labb.machines'"),
        ({"actions": {"wipe": "my_lab.machines:biuld"}}, "'biuld'.*build_wipe"),
        ({"actions": {"wipe": f"{__name__}:plain_value"}}, r"CoglabState.* int\b"),
        ({"actions": {"wipe": f"{__name__}:raises"}}, r"AttributeError.*no_such_port.*test_own_parts.py:\d"),
        ({"actions": {"wipe": f"{__name__}:OtherOutcomes"}}, "failed, preempted, succeeded"),
        ({"actions": {"take": "my_lab.machines:build_wipe"}}, "actions.take"),
        ({"actions": {"wipe": "my_lab.machines"}}, "module:function.*'my_lab.machines'"),
        ({"actions": {"wipe": {"build": "my_lab.machines:build_wipe", "hand": "left"}}}, "actions.wipe"),
        ({"states": {"take/hand_closes": "my_lab.states:Announce"}}, "take/approach_board"),
        ({"deliveries": {"low": "my_lab.deliveries:lower"}}, "deliveries.low: .*'lower'.* low"),
    ],
)
def test_an_unusable_part_is_refused_with_a_reason(settings, said):
    with pytest.raises(ConfigError, match=said):
        Trial(**settings)


def test_a_failing_import_is_reported_with_module_and_line(tmp_path, monkeypatch):
    (tmp_path / "bad_lab.py").write_text("import math\nmath.nonsense\n")
    (tmp_path / "ends_itself.py").write_text("raise SystemExit(3)\n")
    (tmp_path / "lacks_more.py").write_text("import no_such_thing_4714\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    for module, said in (
        ("bad_lab", r"AttributeError.*bad_lab.py:2"),
        ("ends_itself", "SystemExit.*3"),
        ("lacks_more", "'no_such_thing_4714'"),
    ):
        with pytest.raises(ConfigError, match=said):
            Trial(actions={"wipe": f"{module}:build"})


def test_module_beside_machines_yaml_is_found(tmp_path):
    shipped = (Path(__file__).parents[1] / "config" / "machines.yaml").read_text()
    (tmp_path / "lab_4714.py").write_text("from my_lab.machines import build_wipe\n")
    path, warnings = tmp_path / "machines.yaml", []
    path.write_text(shipped + "\nactions: {wipe: lab_4714:build_wipe}\n")
    config = Config.load(str(path), warn=warnings.append)
    before = list(sys.path)
    try:
        assert [own.name for own in Parts.load(config).actions] == ["wipe"]
    finally:
        sys.path[:] = before
    path.write_text(shipped + "\nactions: {polish: lab_4714:no_such}\nptp_timeout: 7.0\n")
    os.utime(path, ns=(5, 5))
    assert config.get("ptp_timeout") == 7.0 and list(config.get("actions")) == ["wipe"]
    assert len(warnings) == 1 and "'actions'" in warnings[0]


def test_every_delivery_of_an_object_can_be_requested():
    trial = Trial(deliveries={"low": "my_lab.deliveries:low", "far": f"{__name__}:no_delivery"})
    given = []

    def script(t):
        names = list(t.database.get("mug")["deliveries"])
        t.wait_hub("wait_without_object")
        assert asks(t, "receive", "mug/low").code == ReasonCode.INVALID_ARGUMENT
        for name, ask in zip([*names, "low"], [(f"/{name}", "") for name in names] + [("mug", "low")], strict=True):
            received(t)
            answer = asks(t, "give", "mug/nonsense")
            assert answer.code == ReasonCode.UNKNOWN_NAME and f"{', '.join(names)}, low" in answer.message
            assert asks(t, "put", "", name).code == ReasonCode.INVALID_ARGUMENT
            assert asks(t, "give", *ask).ok
            t.wait_hub("wait_without_object")
            assert t.result().outcome == "succeeded" and t.master.userdata.delivery_name == name
            given.append(tuple(t.cell.arm.request.goal_offset))
        assert len(set(given)) == len(given), "each delivery has its own place"
        received(t)
        assert asks(t, "give", "", "far").ok
        t.wait_hub("wait_with_object")
        assert "deliveries.far" in t.result().reason and t.result().code == ReasonCode.BAD_FILE
        assert asks(t, "give").ok  # without a name: the default, not the previous one
        t.wait_hub("wait_without_object")
        assert t.master.userdata.delivery_name == t.database.get("mug")["default_delivery"]

    trial.run(script)


@pytest.mark.parametrize(("choice", "grasp"), [("ranked", "side"), ("nominal", "edge")])
def test_the_nominal_grasp_of_an_object_can_be_chosen(choice, grasp):
    trial = Trial(**{"grasp.choice": choice})
    mug = trial.database.get("mug")
    edge = {**mug["grasps"]["side"], "pose": {"xyz": [0.0, -0.04, 0.03], "quaternion": [0.5, 0.5, 0.5, 0.5]}}
    mug["grasps"]["edge"], mug["default_grasp"] = edge, "edge"
    trial.run(received)
    assert trial.master.userdata.grasp_name == grasp


def build_fetch(ctx):
    return build_take(ctx)


def test_a_machine_with_its_own_recovery_is_not_wrapped():
    trial = Trial(actions={"fetch": f"{__name__}:build_fetch"})

    def script(t):
        t.wait_hub("wait_without_object")
        assert asks(t, "fetch", "mug").ok
        t.wait_hub("wait_with_object")
        assert (t.result().kind, t.ctx.holding) == ("fetch", "mug")

    trial.run(script)
    assert "hand_close" in trial.labels("/coglab_master/fetch")


@pytest.mark.parametrize(
    ("group", "name", "call"),
    [
        ("actions", "wipe", "without_arguments(ctx)"),
        ("states", "exchange_human_to_robot/query_database", "without_arguments(ctx)"),
        ("deliveries", "low", "without_arguments(entry, hand)"),
    ],
)
def test_a_function_with_wrong_arguments_is_refused_with_its_line(group, name, call):
    with pytest.raises(ConfigError) as refused:
        Trial(**{group: {name: f"{__name__}:without_arguments"}})
    line = without_arguments.__code__.co_firstlineno
    assert call in str(refused.value) and f"test_own_parts.py:{line}" in str(refused.value)


def test_an_unknown_outcome_is_a_failure_and_the_machine_continues():
    trial = Trial(states={"exchange_human_to_robot/query_database": f"{__name__}:ReturnsNonsense"})

    def script(t):
        t.wait_hub("wait_without_object")
        assert asks(t, "receive", "mug").ok
        t.until(lambda: t.ctx.journal.results[-1].kind == "exchange_human_to_robot")
        assert t.result().outcome == "failed_empty" and "'nonsense'" in t.result().reason
        t.wait_hub("wait_without_object")

    trial.run(script)


def test_an_unknown_action_is_refused_with_the_known_names():
    trial = Trial(actions=WIPE)

    def script(t):
        t.wait_hub("wait_without_object")
        assert asks(t, "receive", "mug").ok
        answer = asks(t, "polish")  # no hub is open now
        assert answer.code == ReasonCode.UNKNOWN_NAME and "wipe" in answer.message

    trial.run(script)
