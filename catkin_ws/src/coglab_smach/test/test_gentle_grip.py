"""Beside a person's hand the fingers close with the lowest force; firmly once it has let go."""

import pytest
from coglab_objects.database import objects_folder, read_object
from coglab_smach.ports.pending import PortError, Ready
from coglab_smach.states.hand import gentle
from conftest import Trial
from ih2_hand.grasps import levels_of

RECEIVE = "exchange_human_to_robot"
OBJECTS = sorted(path.stem for path in objects_folder().glob("*.yaml"))


@pytest.mark.parametrize("object_id", OBJECTS)
def test_the_lowest_level_that_every_dialect_has(object_id):
    entry = read_object(objects_folder() / f"{object_id}.yaml")[0]
    for grasp in entry["grasps"].values():
        hand = gentle(grasp)
        assert hand["mode"] == grasp["hand"]["mode"]
        lowest = levels_of(hand["mode"], "legacy")[0]
        assert lowest in levels_of(hand["mode"], "v17")
        assert hand["level"] == lowest


def receive(trial):
    """Receive the mug, whose own level is medium; (level, motion) of all that the hand was asked for."""
    asked, preshape, close = [], trial.ctx.hand.preshape, trial.ctx.hand.close
    trial.ctx.hand.preshape = lambda mode, level: asked.append(level) or preshape(mode, level)
    trial.ctx.hand.close = lambda speed: asked.append(speed) or close(speed)

    def script(t):
        t.wait_hub("wait_without_object")
        t.start(RECEIVE)
        t.clock.sleep(1.0)
        t.wait_hub("wait_with_object")

    trial.run(script)
    return asked


def test_it_closes_firmly_when_the_person_has_let_go():
    trial = Trial()
    asked = receive(trial)
    assert set(asked[:-1]) == {"low"} and asked[-1] == trial.ctx.config.get("hand.tighten.medium")
    marks = trial.result().marks
    assert marks["released"] <= marks["tightened"]
    calls = [name for _, name in trial.cell.calls]
    home = len(calls) - 1 - calls[::-1].index("move_ptp")
    assert calls.index("close") < len(calls) - 1 - calls[::-1].index("close") < home


def test_a_hand_that_refuses_keeps_what_it_holds():
    trial = Trial()
    refusal = Ready(error=PortError("hand_close refused", ("the port is gone",)))
    trial.ctx.hand.close = lambda speed: refusal

    def script(t):
        t.wait_hub("wait_without_object")
        t.start(RECEIVE)
        t.clock.sleep(1.0)
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "failed_holding" and "hand_tighten" in trial.result().reason
    assert trial.ctx.holding == "mug"
