"""The timings calm and natural in whole trials with a drawn person, by the truth of the cell."""

from coglab_trials import Conditions, VirtualTrial


def receive(timing):
    """The trial, and s from the first movement of the person's hand to that of the arm toward it."""
    trial, onset = VirtualTrial(seed=21001, conditions=Conditions(object_id="mug"), timing=timing), []

    def beside(t):
        if not onset and t.begun and t.rig.human.phase != "idle":
            onset.append(t.rig.t)

    trial.beside = beside
    (result,) = trial.run("exchange_human_to_robot")
    assert result.outcome == "succeeded" and trial.rig.cell.truth()["held_by"] == "robot", result.reason
    return trial.reaches[0].begin - onset[0]


def test_natural_starts_before_calm_and_both_take_the_object():
    # Calm waits 0.3 s more.
    assert receive("calm") - receive("natural") > 0.3
