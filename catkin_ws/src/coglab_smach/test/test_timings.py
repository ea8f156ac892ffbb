"""The timings calm and natural in whole trials: one drawn person gives the mug, by the truth of the cell."""

import sys

from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import campaign
import partner_rows
from coglab_sim.conditions import Conditions

SEED = 21001


def receive(timing):
    """(direction as it ended, s from the onset of the person's reach to that of the arm) of one trial."""
    arguments = {"conditions": Conditions(object_id="mug"), "timing": timing}
    job = campaign.Job(f"timing {timing}", campaign.EXCHANGES[:1], SEED, arguments, partner_rows.handover)
    trial = campaign.run_job(job)
    assert not trial["stuck"] and not trial["fell"], trial["stuck"]
    (each,) = partner_rows.directions(job, trial)
    return each, each.truth["arm_onset"] - each.truth["onset"]


def test_natural_starts_before_calm_and_both_take_the_object():
    (calm, after_calm), (natural, after_natural) = receive("calm"), receive("natural")
    for each in (calm, natural):
        assert (each.end, each.truth["held_by"]) == ("succeeded", "robot"), (each.end, each.sentence)
    # Calm waits 0.3 s more from what it can see later.
    assert after_calm - after_natural > 0.3, (after_calm, after_natural)
