"""A compliant approach: its feedback profile is on during the reach and off before release is armed at rest."""

import pytest
from conftest import Trial

ACTIONS = {"contact": "exchange_human_to_robot", "release": "exchange_robot_to_human"}


def handover(t):
    t.begin(ACTIONS["contact"])
    t.wait_hub("wait_with_object")
    t.start(ACTIONS["release"])
    t.wait_hub("wait_without_object")


def test_profile_is_on_in_the_reach_and_off_before_release_is_armed():
    """Contact is detected while the compliant arm moves; release is detected at rest."""
    trial = Trial(approach_profile="dmp_compliant")
    trial.run(handover)
    assert [r.outcome for r in trial.ctx.journal.results[-2:]] == ["succeeded", "succeeded"]
    order = [
        what
        for what in trial.cell.called()
        if what.startswith(("switch", "profile", "execute_dmp", "arm contact", "arm release"))
    ]
    reach = ["switch dmp", "profile dmp_compliant", "execute_dmp"]
    first = order.index("switch dmp")
    assert order[first:][:4] == [*reach, "arm contact_in_motion"]
    again = order.index("switch dmp", first + 1)
    assert "switch ptp" in order[first:again], "the end of the reach ends its profile"
    after = [what for what in order[again:] if what != "switch ptp"]
    assert after[:5] == [*reach, "profile dmp", "arm release"]
    assert not trial.ctx.contact.armed_while_moving
    assert "compliant" not in trial.ctx.contact.armed_with_profile[-1]


def test_release_is_not_armed_while_the_correction_fades():
    trial = Trial(approach_profile="dmp_compliant")
    trial.cell.fade_time = 1.5
    trial.run(handover)
    left = max(stamp for stamp, what in trial.cell.calls if what == "profile dmp")
    armed = max(stamp for stamp, what in trial.cell.calls if what == "arm release")
    assert armed - left >= 1.5


@pytest.mark.parametrize("fault", ["refused", "never fades"])
def test_a_profile_that_cannot_be_left_ends_the_reach(fault):
    trial = Trial(approach_profile="dmp_compliant")
    if fault == "refused":
        trial.cell.faults.refuse["profile dmp"] = "there is no profile 'dmp'"
    else:
        trial.cell.fade_time = 1e9

    def script(t):
        t.begin(ACTIONS["contact"])
        t.clock.sleep(30.0)

    trial.run(script)
    assert "close" not in trial.cell.called()
    assert trial.result().outcome != "succeeded"
    why = trial.ctx.journal.why()
    assert ("'dmp'" if fault == "refused" else "ee_admittance") in why
