"""exchange_human_to_robot (D4.10 Figure 5): the person gives, the robot takes."""

from __future__ import annotations

from coglab_smach.context.context import Context
from coglab_smach.machines.approach import build_approach
from coglab_smach.machines.recovery import ACTION_OUTCOMES, RECOVERY_TRANSITIONS, build_recovery, to_recovery
from coglab_smach.states.arm import HomeRobot, SwitchController
from coglab_smach.states.base import CoglabMachine
from coglab_smach.states.hand import HandClose, HandPreshape, HandTighten
from coglab_smach.states.knowledge import QueryDatabase, SetGraspGoal
from coglab_smach.states.regrasp import Regrasp
from coglab_smach.states.weight import TakeWeight

SHARED = ["object_entry", "grasp", "grasp_name"]


def build_exchange_human_to_robot(ctx: Context) -> CoglabMachine:
    """query -> goal from the best grasp -> reach and preshape -> contact -> close gently -> take the weight -> tighten
    (if the person's hand was seen to leave) -> home -> tighten there otherwise.

    If the hand closed on nothing, it opens to its preshape and the arm reaches once more. If it closed on an edge, it
    opens, retreats, goes to the grasp as it is seen now, and closes again."""
    machine = CoglabMachine(
        ctx, "exchange_human_to_robot", ACTION_OUTCOMES, input_keys=["object_id"], output_keys=SHARED, io_keys=["grip"]
    )
    machine.is_action = True
    with machine:
        machine.add_state("query_database", QueryDatabase(ctx), to_recovery(succeeded="set_dmp_goal"))
        machine.add_state("set_dmp_goal", SetGraspGoal(ctx), to_recovery(succeeded="approach"))
        machine.add_state(
            "approach",
            build_approach(ctx, "approach", "contact", preshape=True, monitor=True),
            to_recovery(succeeded="switch_to_ptp"),
        )
        machine.add_state("switch_to_ptp", SwitchController(ctx, "ptp"), to_recovery(succeeded="hand_close"))
        machine.add_state(
            "hand_close",
            HandClose(ctx, from_person=True),
            to_recovery(succeeded="take_weight", missed="open_again", edge="open_to_regrasp"),
        )
        machine.add_state("open_again", HandPreshape(ctx), to_recovery(succeeded="set_dmp_goal"))
        machine.add_state("open_to_regrasp", HandPreshape(ctx), to_recovery(succeeded="regrasp"))
        machine.add_state("regrasp", Regrasp(ctx), to_recovery(succeeded="hand_close"))
        machine.add_state("take_weight", TakeWeight(ctx), to_recovery(succeeded="hand_tighten"))
        machine.add_state("hand_tighten", HandTighten(ctx), to_recovery(succeeded="coglab_home_robot"))
        machine.add_state("coglab_home_robot", HomeRobot(ctx, carries=True), to_recovery(succeeded="tighten_at_home"))
        machine.add_state("tighten_at_home", HandTighten(ctx, at_home=True), to_recovery(succeeded="succeeded"))
        machine.add_state("recover", build_recovery(ctx), RECOVERY_TRANSITIONS)
    return machine
