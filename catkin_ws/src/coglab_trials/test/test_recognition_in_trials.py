"""Recognition of the partner's reach in whole trials: monitor_dmp substitutes the primitive; a reach leaves a hub."""

from pathlib import Path

import numpy as np
import pytest
import smach
from coglab_perception.recogniser import Recogniser, load_patterns
from coglab_trials.trial import VirtualTrial

PATTERNS = str(Path(__file__).resolve().parents[2] / "coglab_perception" / "config" / "patterns.json")
GIVE = "exchange_human_to_robot"


@pytest.fixture(autouse=True)
def quiet():
    """The engine's log helps nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)


def trial_of(**kw):
    return VirtualTrial(
        seed=5, recogniser=Recogniser(*load_patterns(PATTERNS)), profile="accustomed", perfect=True, **kw
    )


class Told(Recogniser):
    """Keeps what it was told, and whose end it was asked for."""

    def __init__(self):
        super().__init__(*load_patterns(PATTERNS))
        self.told, self.asked = [], []

    def update(self, stamp, position):
        self.told.append(stamp)
        return super().update(stamp, position)

    def pattern_end(self):
        self.asked.append(self.told[-1])
        return super().pattern_end()


def test_each_sight_is_recognised_once_and_before_it_is_believed():
    """As in the recogniser's node, which takes every new transform: none is left out, however they come."""
    trial, sights = VirtualTrial(seed=5, recogniser=Told()), []

    def look(trial):
        stamp = trial.rig.sights["human_hand"].captured if "human_hand" in trial.rig.sights else None
        if stamp is not None and sights[-1:] != [stamp]:
            sights.append(stamp)

    trial.beside = look
    trial.run(script=lambda trial: trial.clock.sleep(3.0))
    assert len(sights) > 30 and trial.recogniser.told == trial.recogniser.asked == sights


def test_an_object_held_high_gets_the_primitive_for_it():
    trial = trial_of()
    trial.rig.scene.handover_object = np.array([0.78, 0.03, 0.60])
    trial.rig.scene.region_high = np.array([0.81, 0.16, 0.66])
    results = trial.run(GIVE)
    switched = [t.reason for t in trial.ctx.journal.transitions if t.outcome == "switched"]
    assert len(switched) == 1 and "pattern 'high' recognised" in switched[0]
    assert "primitive 'reach_human' replaced by 'reach_human_high'" in switched[0]
    assert trial.rig.robot.progress["primitive"] == "reach_human_high"
    assert results[0].outcome == "succeeded", results[0].reason
    assert trial.rig.robot.limit_violations == 0 and trial.ctx.contact.watched_while_moving == 0


def test_a_common_reach_keeps_the_primitive():
    trial = trial_of()
    results = trial.run(GIVE)
    assert results[0].outcome == "succeeded", results[0].reason
    assert not [t for t in trial.ctx.journal.transitions if t.outcome == "switched"]


def test_a_person_who_reaches_out_starts_the_exchange():
    trial = trial_of(**{"recognition_trigger.enabled": True})

    def script(t):
        t.wait_hub("wait_without_object")
        t.clock.sleep(1.0)
        t.rig.human.command("give")
        t.wait_hub("wait_with_object")
        t.clock.sleep(4.0)
        assert t.ctx.requests.hub() == "wait_with_object", "the hand that went back counted as a reach"

    trial.run(script=script)
    asked = [t for t in trial.ctx.journal.transitions if t.from_state == "wait_without_object"]
    assert asked[0].outcome == GIVE and "belief in an offer of 'mug'" in asked[0].reason
