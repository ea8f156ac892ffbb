"""The bench of contact in motion: what it gives a detector of a quiet reach can each be a false alarm, and a sample
meets no goal."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_smach.contact.evidence import FINGERS, SIGHT, TACTILE
from coglab_smach.kinematics.reachability import default_arm

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import bench_contact_motion as bench
from coglab_smach.contact.motion_thresholds import Thresholds

SEED = 21010
THRESHOLDS = Thresholds.load(package_path("coglab_smach", "config", "contact_thresholds.yaml"))


@pytest.fixture
def quiet():
    """A reach of an empty hand that nothing touches."""
    record = bench.MovingReach(SEED).run()
    assert record.payload[0] == 0.0 and record.reached is not None
    return record


def test_nothing_is_felt_nor_seen_in_a_quiet_reach_but_each_source_is_heard(quiet):
    event, _, _ = bench.watch(quiet, THRESHOLDS, touch=True, everything=True)
    assert event is None, event
    late = int(np.searchsorted(quiet.stamp, quiet.begun + 0.5))
    assert len({id(read) for read in quiet.hand[late:]}) > 3 and len(quiet.hand[late]) == 5

    def source(**parts):
        changed = SimpleNamespace(**{**vars(quiet), **parts})
        found, _, _ = bench.watch(changed, THRESHOLDS, touch=True, everything=True)
        return None if found is None else found.source

    moved = [SimpleNamespace(**{**vars(motor), "position": motor.position + 20}) for motor in quiet.hand[late]]
    assert source(hand=[*quiet.hand[:late], *[moved] * (len(quiet.hand) - late)]) == FINGERS
    pressed = {name: force + 2.0 for name, force in quiet.touch[late].items()}
    assert source(touch=[*quiet.touch[:late], *[pressed] * (len(quiet.touch) - late)]) == TACTILE
    there = bench.grasp_of(bench.FRAME).inverse()
    palms = [Pose(*default_arm().fk(position)) * there for position in quiet.position]
    assert source(sight=list(zip(quiet.stamp, palms, strict=True))) == SIGHT


def test_a_sample_of_reaches_meets_no_goal(monkeypatch):
    got = bench.judged("false alarms", 0, "reaches", "<= 1 of 500", True, "")
    assert not got["ok"] and got["figure"] == "false alarms [sample of 12 of 500 asked: missed]"
    monkeypatch.setattr(bench, "COUNTS", bench.ASKED)
    assert bench.judged("false alarms", 0, "reaches", "<= 1 of 500", True, "")["ok"]
    assert not bench.judged("false alarms", 2, "reaches", "<= 1 of 500", False, "")["ok"]
