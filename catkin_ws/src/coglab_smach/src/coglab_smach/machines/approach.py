"""The reach that all actions share: arm motion, hand preshape and monitor_dmp in parallel."""

from __future__ import annotations

from coglab_smach.context.context import Context
from coglab_smach.states.arm import SwitchController
from coglab_smach.states.base import CoglabConcurrence, CoglabMachine, require_all
from coglab_smach.states.give import WaitTaker
from coglab_smach.states.hand import HandPreshape
from coglab_smach.states.monitor import MonitorDmp
from coglab_smach.states.reach import ExecuteDmp, WaitContact, WaitStop

KEYS = ["goal", "grasp", "object_entry", "object_id"]
TAKER_KEYS = [*KEYS, "delivery"]


def build_arm_motion(ctx: Context, trigger: str) -> CoglabMachine:
    """switch_to_dmp, execute_dmp (only starts the motion), wait_stop (waits for its end)."""
    machine = CoglabMachine(
        ctx,
        "arm_motion",
        ["succeeded", "failed", "preempted"],
        input_keys=TAKER_KEYS if trigger == "taker" else KEYS,
        io_keys=["grip"],
    )
    with machine:
        machine.add_state("switch_to_dmp", SwitchController(ctx, "dmp"), {"succeeded": "execute_dmp"})
        machine.add_state("execute_dmp", ExecuteDmp(ctx), {"succeeded": "wait_stop"})
        wait_stop = {"taker": WaitTaker, "contact": WaitContact, "": WaitStop}[trigger]
        machine.add_state("wait_stop", wait_stop(ctx), {"succeeded": "succeeded"})
    return machine


def build_approach(ctx: Context, label: str, trigger: str, preshape: bool, monitor: bool) -> CoglabConcurrence:
    """Concurrence of arm_motion and, optionally, hand_preshape and monitor_dmp. Outcomes: succeeded, failed,
    preempted."""
    essential = ["arm_motion", "hand_preshape"] if preshape else ["arm_motion"]
    decide, conclude = require_all(essential)
    group = CoglabConcurrence(
        ctx,
        label,
        ["succeeded", "failed", "preempted"],
        "failed",
        decide,
        conclude,
        input_keys=TAKER_KEYS if trigger == "taker" else KEYS,
        io_keys=["grip"],
    )
    with group:
        group.add_state("arm_motion", build_arm_motion(ctx, trigger))
        if preshape:
            group.add_state("hand_preshape", HandPreshape(ctx))
        if monitor:
            group.add_state("monitor_dmp", MonitorDmp(ctx))
    return group
