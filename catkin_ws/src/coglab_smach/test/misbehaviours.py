"""Documented outcomes of an exchange with a person who misbehaves (README: "Misbehaving partners")."""

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"

OUTCOMES = {
    (RECEIVE, "slow"): {"succeeded"},
    (RECEIVE, "hesitant"): {"succeeded"},
    (RECEIVE, "change_side"): {"succeeded", "failed_empty"},
    (RECEIVE, "tug"): {"succeeded"},
    (RECEIVE, "absent"): {"failed_empty"},
    (RECEIVE, "early_release"): {"failed_empty", "succeeded"},
    (RECEIVE, "never_release"): {"failed_empty"},
    (RECEIVE, "pull_back"): {"succeeded", "failed_empty"},
    (RECEIVE, "early_contact"): {"succeeded", "failed_empty"},
    (GIVE, "slow"): {"succeeded"},
    (GIVE, "hesitant"): {"succeeded"},
    (GIVE, "change_side"): {"succeeded"},
    (GIVE, "absent"): {"failed_holding"},
    (GIVE, "early_release"): {"failed_holding"},
    (GIVE, "never_release"): {"succeeded"},
    (GIVE, "pull_back"): {"failed_holding"},
}
"""(action, behaviour) -> outcomes that are as documented"""
