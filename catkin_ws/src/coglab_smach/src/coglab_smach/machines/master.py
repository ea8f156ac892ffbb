"""coglab_master (D4.10 Figure 3): initialisation, then two hubs. Each action starts in a hub and returns to one."""

from __future__ import annotations

from coglab_py.actions import SHORT_NAMES, WAYS_OUT

from coglab_smach.context.config import ConfigError
from coglab_smach.context.context import Context
from coglab_smach.machines.board import build_put, build_take
from coglab_smach.machines.exchange_human_to_robot import build_exchange_human_to_robot
from coglab_smach.machines.exchange_robot_to_human import build_exchange_robot_to_human
from coglab_smach.machines.init import build_init_system
from coglab_smach.machines.own_action import build_own_action
from coglab_smach.machines.recovery import WhatIsHeld, build_recovery
from coglab_smach.states.base import CoglabMachine
from coglab_smach.states.hub import Fault, Hub, Stopped

ACTIONS_EMPTY = ("exchange_human_to_robot", "take")
ACTIONS_HOLDING = ("exchange_robot_to_human", "put")
LABEL = "coglab_master"
SHIPPED = ("coglab_init_system", "which_hub", "wait_without_object", "wait_with_object", "stopped", "fault", "recover")
TAKEN = (*SHIPPED, *ACTIONS_EMPTY, *ACTIONS_HOLDING, *SHORT_NAMES, *WAYS_OUT)
"""Names that no action of a user can have."""


def _after_action(succeeded: str) -> dict[str, str]:
    return {
        "succeeded": succeeded,
        "failed_empty": "wait_without_object",
        "failed_holding": "wait_with_object",
        "stopped": "stopped",
        "fault": "fault",
        "preempted": "preempted",
    }


def actions_of(ctx: Context, shipped: tuple[str, ...], hand: str) -> tuple[str, ...]:
    """Returns the actions of a hub: the shipped ones, then the user's. ``hand``: "empty" or "holding"."""
    return shipped + tuple(own.name for own in ctx.parts.actions if own.hand in (hand, "any"))


def build_master(ctx: Context) -> CoglabMachine:
    """Returns the whole hierarchy. Its only outcome is 'preempted', at shut-down. ConfigError: a part of a user's
    package, named in machines.yaml, cannot be used."""
    for own in ctx.parts.actions:
        if own.name in TAKEN:
            raise ConfigError(f"actions.{own.name}: this name is in use; choose another one")
    empty, holding = actions_of(ctx, ACTIONS_EMPTY, "empty"), actions_of(ctx, ACTIONS_HOLDING, "holding")
    ctx.requests.known = tuple(dict.fromkeys([*empty, *holding, "initialise", "reset"]))
    master = CoglabMachine(ctx, LABEL, ["preempted"])
    master.userdata.object_id = master.userdata.grasp_name = master.userdata.delivery_name = ""
    master.userdata.object_entry, master.userdata.grasp = {}, {}
    with master:
        master.add_state(
            "coglab_init_system",
            build_init_system(ctx),
            {"succeeded": "which_hub", "failed": "fault", "preempted": "preempted"},
        )
        # After a repair, the hand may still hold the object of the failed action.
        master.add_state(
            "which_hub",
            WhatIsHeld(ctx),
            {
                "empty": "wait_without_object",
                "holding": "wait_with_object",
                "failed": "fault",
                "preempted": "preempted",
            },
        )
        master.add_state(
            "wait_without_object",
            Hub(ctx, empty, with_object=False),
            {action: action for action in empty} | {"stopped": "stopped", "failed": "fault", "preempted": "preempted"},
        )
        master.add_state(
            "exchange_human_to_robot", build_exchange_human_to_robot(ctx), _after_action("wait_with_object")
        )
        master.add_state("take", build_take(ctx), _after_action("wait_with_object"))
        master.add_state(
            "wait_with_object",
            Hub(ctx, holding, with_object=True),
            {action: action for action in holding}
            | {"stopped": "stopped", "failed": "fault", "preempted": "preempted"},
        )
        master.add_state(
            "exchange_robot_to_human", build_exchange_robot_to_human(ctx), _after_action("wait_without_object")
        )
        master.add_state("put", build_put(ctx), _after_action("wait_without_object"))
        for own in ctx.parts.actions:
            master.add_state(own.name, build_own_action(ctx, own), _after_action("which_hub"))
        master.add_state("stopped", Stopped(ctx), {"succeeded": "recover", "failed": "fault", "preempted": "preempted"})
        master.add_state(
            "fault", Fault(ctx), {"succeeded": "coglab_init_system", "failed": "fault", "preempted": "preempted"}
        )
        master.add_state(
            "recover",
            build_recovery(ctx, operator=True),
            {
                "empty": "wait_without_object",
                "holding": "wait_with_object",
                "stopped": "stopped",
                "fault": "fault",
                "preempted": "preempted",
            },
        )
    ctx.parts.all_placed()
    return master
