"""An action of a user's package, named in machines.yaml: ``actions: {polish: my_lab.machines:build_polish}``."""

from __future__ import annotations

from coglab_smach.context.config import ConfigError
from coglab_smach.context.context import Context
from coglab_smach.context.parts import OwnAction, built, type_name
from coglab_smach.machines.recovery import ACTION_OUTCOMES, RECOVERY_TRANSITIONS, build_recovery, to_recovery
from coglab_smach.states.base import CoglabConcurrence, CoglabMachine, CoglabState

BODY_OUTCOMES = {"succeeded", "failed", "preempted"}
KEYS = ["object_id", "object_entry", "grasp", "grasp_name", "delivery_name", "grip"]
"""User data that every action may read and write."""


def build_own_action(ctx: Context, own: OwnAction) -> CoglabMachine:
    """Returns the machine of the action. ConfigError if the user's function returns something else.

    The function returns a state or machine with the outcomes succeeded, failed and preempted. A failure goes through
    the recovery of the shipped actions: the arm comes home, the hand is open or holds its object. A machine that
    contains its own recovery (``is_action`` is True, with the outcomes of the shipped actions) stays as it is.
    """
    name = f"actions.{own.name}"
    body = built(name, own.build, ctx)
    if not isinstance(body, CoglabState | CoglabMachine | CoglabConcurrence):
        raise ConfigError(
            f"{name}: its function has to return a CoglabState or a CoglabMachine of coglab_smach.states.base, it "
            f"returned {type_name(body)}"
        )
    outcomes = set(body.get_registered_outcomes())
    if isinstance(body, CoglabMachine) and body.is_action:
        _expect(name, outcomes, set(ACTION_OUTCOMES))
        return body
    _expect(name, outcomes, BODY_OUTCOMES)
    action = CoglabMachine(ctx, own.name, ACTION_OUTCOMES, io_keys=KEYS)
    action.is_action = True
    with action:
        action.add_state(body.label, body, to_recovery(succeeded="succeeded"))
        action.add_state("recover", build_recovery(ctx), RECOVERY_TRANSITIONS)
    return action


def _expect(name: str, outcomes: set[str], expected: set[str]) -> None:
    if outcomes != expected:
        raise ConfigError(
            f"{name}: its outcomes have to be {', '.join(sorted(expected))}; they are {', '.join(sorted(outcomes))}"
        )
