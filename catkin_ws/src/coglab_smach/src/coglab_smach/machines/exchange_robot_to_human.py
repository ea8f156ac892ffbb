"""exchange_robot_to_human (D4.10 Figure 6): the robot gives, the person takes."""

from __future__ import annotations

from coglab_smach.context.context import Context
from coglab_smach.machines.approach import build_approach
from coglab_smach.machines.recovery import ACTION_OUTCOMES, RECOVERY_TRANSITIONS, build_recovery, to_recovery
from coglab_smach.states.arm import HomeRobot, SwitchController
from coglab_smach.states.base import CoglabMachine
from coglab_smach.states.give import GiveLoad
from coglab_smach.states.hand import HandOpen, LetGo
from coglab_smach.states.knowledge import SetDeliveryGoal


def build_exchange_robot_to_human(ctx: Context) -> CoglabMachine:
    """delivery goal (no new query: user data contains the entry) -> reach -> give the load -> let go -> home."""
    machine = CoglabMachine(
        ctx,
        "exchange_robot_to_human",
        ACTION_OUTCOMES,
        input_keys=["object_id", "object_entry", "grasp", "grasp_name"],
        io_keys=["grip", "delivery_name"],
    )
    machine.is_action = True
    with machine:
        machine.add_state("set_dmp_goal", SetDeliveryGoal(ctx), to_recovery(succeeded="approach"))
        machine.add_state(
            "approach",
            build_approach(ctx, "approach", "taker", preshape=False, monitor=True),
            to_recovery(succeeded="switch_to_ptp"),
        )
        machine.add_state("switch_to_ptp", SwitchController(ctx, "ptp"), to_recovery(succeeded="give_load"))
        machine.add_state("give_load", GiveLoad(ctx), to_recovery(succeeded="hand_open"))
        machine.add_state("hand_open", LetGo(ctx), to_recovery(succeeded="coglab_home_robot"))
        machine.add_state("coglab_home_robot", HomeRobot(ctx, gave=True), to_recovery(succeeded="open_at_home"))
        machine.add_state("open_at_home", HandOpen(ctx), to_recovery(succeeded="succeeded"))
        machine.add_state("recover", build_recovery(ctx), RECOVERY_TRANSITIONS)
    return machine
