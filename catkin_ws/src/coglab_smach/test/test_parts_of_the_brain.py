"""Single parts of the brain: memory and configuration, triggers and the journal, structure of the machines, and states
that wait for the operator or start a motion."""

import json
import os
from types import SimpleNamespace

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.context.holding import HoldingMemory
from coglab_smach.context.requests import ask_for
from coglab_smach.ports.interfaces import Verdict
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states.arm import ConfigureLwr, PtpMotion
from coglab_trials.virtual_clock import using
from conftest import Trial
from test_master_node import script

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"

# --- memory and configuration -----------------------------------------------------------------------------------------


def test_the_note_of_the_held_object_is_written_in_one_step_and_read_again(tmp_path, monkeypatch):
    path, warnings = tmp_path / "a" / "b" / "holding.json", []
    memory = HoldingMemory(str(path), warnings.append)
    assert memory.recall() == "" and warnings == []
    memory.note("mug")
    assert memory.recall() == "mug" and os.listdir(path.parent) == ["holding.json"]
    for text in ("[]", "{}", "{"):
        path.write_text(text)
        assert memory.recall() == ""
    assert len(warnings) == 3
    HoldingMemory(str(tmp_path / "a"), warnings.append).note("mug")
    assert str(tmp_path / "a") in warnings[3]
    HoldingMemory().note("mug")
    assert HoldingMemory().recall() == ""
    module, shown = script("master_node"), []
    monkeypatch.setattr(module.rospy, "Publisher", lambda name, kind, queue_size, latch: (name, latch))
    monkeypatch.setattr(module, "publish", lambda to, message: shown.append((to, message.data)))
    module.Memory(str(path), warnings.append).note("ball")
    assert json.loads(path.read_text()) == {"object_id": "ball"} and shown == [(("coglab/holding", True), "ball")]


# --- triggers and the journal -----------------------------------------------------------------------------------------


def test_a_trigger_waits_two_seconds_for_the_database():
    for after, ok in ((1.9, True), (2.1, False)):
        trial = Trial()
        clock = trial.clock
        trial.ctx.database.list_objects = lambda clock=clock, after=after: Polled(
            lambda: clock.now() >= after, lambda: ["mug"], lambda: None
        )
        trial.ctx.requests.open("hub", ["take"], default_object="mug")
        with using(clock):
            answer = ask_for(trial.ctx, "take")
        assert answer.ok == ok and clock.now() == pytest.approx(min(after, 2.0), abs=0.011)
        assert ok or answer.code == ReasonCode.NODE_SILENT


# --- structure of the machines ----------------------------------------------------------------------------------------


def test_an_object_from_the_board_keeps_its_grasp_and_may_be_named_again(trial):
    def walk(t):
        t.wait_hub("wait_without_object")
        t.grip.firm = 140
        t.start("take")
        t.wait_hub("wait_with_object")
        assert t.grip.firm == 0 and not t.grip.shared
        t.start("put", "mug")
        t.wait_hub("wait_without_object")

    trial.run(walk)
    reasons = [t.reason for t in trial.ctx.journal.transitions if t.from_state == "wait_with_object"]
    assert "put" in reasons[0] and "'mug'" in reasons[0]


# --- states -----------------------------------------------------------------------------------------------------------


def ran(trial, state, **ud):
    """Returns the state's outcome and its duration (s)."""
    state.allow(state.time_limit())
    with using(trial.clock):
        begin = trial.clock.now()
        return state.run(SimpleNamespace(**ud)), trial.clock.now() - begin


def test_an_arm_left_in_another_mode_is_stopped_first():
    trial, asked = Trial(), []
    trial.ctx.arm.motion_allowed = lambda: Verdict("start" in asked, "why", 9)

    def command(event):
        asked.append(event)
        refused = event == "position" and "stop" not in asked
        return Ready(error=PortError("send stop first")) if refused else Ready("done")

    trial.ctx.arm.lwr_command = command
    assert ran(trial, ConfigureLwr(trial.ctx))[0] == "succeeded" and asked == ["position", "stop", "position", "start"]


@pytest.mark.parametrize(("holds", "code", "tries"), [(2, 405, 3), (9, 405, 4), (9, 403, 1)])
def test_motion_home_is_resumed_once_the_person_has_let_go(holds, code, tries):
    """The person holds the arm for ``holds`` tries. 405: target not reached; 403: a joint is at its limit."""
    trial = Trial()
    state, begun, home = PtpMotion(trial.ctx, "home"), [], trial.ctx.config.get("postures.home")
    trial.ctx.arm.joint_positions = lambda: tuple(home)
    trial.ctx.arm.switch_controller = lambda *a: Ready()

    def move_ptp(*_):
        begun.append(trial.clock.now())
        return Ready(error=PortError("ended before its target", code=code) if len(begun) <= holds else None)

    trial.ctx.arm.move_ptp = move_ptp
    if tries > holds:
        assert ran(trial, state)[0] == "succeeded"
    else:
        with pytest.raises(PortError) as error:
            ran(trial, state)
        assert error.value.code == code
    assert len(begun) == tries and all(b - a >= 1.0 for a, b in zip(begun, begun[1:], strict=False))
