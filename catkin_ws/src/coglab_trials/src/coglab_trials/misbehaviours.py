"""Documented outcomes of an exchange with a person who misbehaves (README: "Misbehaving partners")."""

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"

BY_HOLDER = ("succeeded", "failed_empty")
"""where the robot holds the object in the end, in truth; where it does not"""
OUTCOMES = {
    (RECEIVE, "slow"): "succeeded",
    (RECEIVE, "hesitant"): "succeeded",
    (RECEIVE, "change_side"): BY_HOLDER,
    (RECEIVE, "tug"): "succeeded",
    (RECEIVE, "absent"): "failed_empty",
    (RECEIVE, "early_release"): BY_HOLDER,
    (RECEIVE, "never_release"): "failed_empty",
    (RECEIVE, "pull_back"): BY_HOLDER,
    (RECEIVE, "early_contact"): BY_HOLDER,
    (GIVE, "slow"): "succeeded",
    (GIVE, "hesitant"): "succeeded",
    (GIVE, "change_side"): "succeeded",
    (GIVE, "absent"): "failed_holding",
    (GIVE, "early_release"): "failed_holding",
    (GIVE, "never_release"): "succeeded",
    (GIVE, "pull_back"): "failed_holding",
}
"""(action, behaviour) -> the outcome that is documented, or the two between which the true holder decides"""


def documented(action, behaviour, holder):
    """The one outcome that is right; ``holder``: who holds the object after the action, as the cell has it."""
    outcome = OUTCOMES[(action, behaviour)]
    return outcome if isinstance(outcome, str) else outcome[0 if holder == "robot" else 1]
