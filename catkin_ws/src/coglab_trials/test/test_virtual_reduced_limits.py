"""With the reduced limits of the operating mode T1, on the real controllers, what takes long is waited for. The way
to the board and back by default; COGLAB_LONG=1: all four actions. (test_motion_ownership: all four on the simulated
arm.)"""

import copy
import os

import pytest
import smach
import yaml
from coglab_trials.trial import VirtualTrial
from coglab_trials.world import LIMITS

LONG = os.environ.get("COGLAB_LONG") == "1"
SESSION = ("exchange_human_to_robot", "put", "take", "exchange_robot_to_human")


@pytest.mark.parametrize("actions, where", [(("take",), "world")] + [(SESSION, "human_hand")] * LONG)
def test_actions_succeed_within_t1(tmp_path, actions, where):
    smach.set_loggers(*[lambda *a: None] * 4)
    table = yaml.safe_load(open(LIMITS, encoding="utf-8"))
    reduced = tmp_path / "joint_limits.yaml"
    reduced.write_text(yaml.safe_dump({**table, "default": {**table["default"], **copy.deepcopy(table["t1"])}}))
    trial = VirtualTrial(seed=3, object_on=where, limits=str(reduced), profile="accustomed", perfect=True)
    results = trial.run(*actions, limit=200.0)
    wanted = [(action, "succeeded") for action in actions]
    assert [(r.kind, r.outcome) for r in results] == wanted, trial.ctx.journal.why()
    assert trial.rig.robot.limit_violations == 0
    # Fixed limits for the full speed would not have been enough: the way to the board alone takes 20 s.
    assert max(r.ended - r.started for r in results) > 40.0
