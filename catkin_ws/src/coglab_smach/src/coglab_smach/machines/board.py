"""take and put (D4.10 Figures 7 and 8): the robot uses the storage board instead of a person."""

from __future__ import annotations

from coglab_smach.context.context import Context
from coglab_smach.machines.approach import build_approach
from coglab_smach.machines.recovery import ACTION_OUTCOMES, RECOVERY_TRANSITIONS, build_recovery, to_recovery
from coglab_smach.states.arm import HomeRobot, PtpMotion, SwitchController
from coglab_smach.states.base import CoglabConcurrence, CoglabMachine, CoglabState, require_all
from coglab_smach.states.hand import HandClose, HandOpen, HandPreshape
from coglab_smach.states.knowledge import FindPlace, LocateOnBoard, QueryDatabase, SetPlaceGoal, SetTakeGoal


def build_look_while_moving(
    ctx: Context, label: str, look_label: str, look: CoglabState, output_key: str
) -> CoglabConcurrence:
    """The arm moves to the board while perception searches."""
    decide, conclude = require_all([look_label, "move_to_board"])
    group = CoglabConcurrence(
        ctx,
        label,
        ["succeeded", "failed", "preempted"],
        "failed",
        decide,
        conclude,
        input_keys=["object_id"],
        output_keys=[output_key],
    )
    with group:
        group.add_state(look_label, look)
        group.add_state("move_to_board", PtpMotion(ctx, "board"))
    return group


def build_take(ctx: Context) -> CoglabMachine:
    """query -> locate while moving to the board -> preshape -> precise DMP motion -> close -> home.

    ``take.preshape`` in the configuration: 'before' or 'during' the precise motion. Read when the machine is built.
    """
    during = ctx.config.text("take.preshape") == "during"
    outputs = ["object_entry", "grasp", "grasp_name"]
    machine = CoglabMachine(ctx, "take", ACTION_OUTCOMES, ["object_id"], outputs, io_keys=["grip"])
    machine.is_action = True
    with machine:
        machine.add_state("query_database", QueryDatabase(ctx), to_recovery(succeeded="approach_board"))
        machine.add_state(
            "approach_board",
            build_look_while_moving(ctx, "approach_board", "locate_object", LocateOnBoard(ctx), "located"),
            to_recovery(succeeded="set_dmp_goal"),
        )
        machine.add_state(
            "set_dmp_goal", SetTakeGoal(ctx), to_recovery(succeeded="precise_motion" if during else "hand_preshape")
        )
        if not during:
            machine.add_state("hand_preshape", HandPreshape(ctx), to_recovery(succeeded="precise_motion"))
        machine.add_state(
            "precise_motion",
            build_approach(ctx, "precise_motion", "", preshape=during, monitor=False),
            to_recovery(succeeded="switch_to_ptp"),
        )
        machine.add_state("switch_to_ptp", SwitchController(ctx, "ptp"), to_recovery(succeeded="hand_close"))
        machine.add_state("hand_close", HandClose(ctx, from_person=False), to_recovery(succeeded="leave_board"))
        machine.add_state("leave_board", PtpMotion(ctx, "board"), to_recovery(succeeded="coglab_home_robot"))
        machine.add_state("coglab_home_robot", HomeRobot(ctx), to_recovery(succeeded="succeeded"))
        machine.add_state("recover", build_recovery(ctx), RECOVERY_TRANSITIONS)
    return machine


def build_put(ctx: Context) -> CoglabMachine:
    """free place while moving to the board -> precise DMP motion -> open -> home. Ends with an empty hand."""
    machine = CoglabMachine(
        ctx, "put", ACTION_OUTCOMES, input_keys=["object_id", "object_entry", "grasp", "grasp_name"], io_keys=["grip"]
    )
    machine.is_action = True
    with machine:
        machine.add_state(
            "approach_board",
            build_look_while_moving(ctx, "approach_board", "free_places", FindPlace(ctx), "place"),
            to_recovery(succeeded="set_dmp_goal"),
        )
        machine.add_state("set_dmp_goal", SetPlaceGoal(ctx), to_recovery(succeeded="precise_motion"))
        machine.add_state(
            "precise_motion",
            build_approach(ctx, "precise_motion", "", preshape=False, monitor=False),
            to_recovery(succeeded="switch_to_ptp"),
        )
        machine.add_state("switch_to_ptp", SwitchController(ctx, "ptp"), to_recovery(succeeded="hand_open"))
        machine.add_state("hand_open", HandOpen(ctx), to_recovery(succeeded="leave_board"))
        machine.add_state("leave_board", PtpMotion(ctx, "board"), to_recovery(succeeded="coglab_home_robot"))
        machine.add_state("coglab_home_robot", HomeRobot(ctx), to_recovery(succeeded="succeeded"))
        machine.add_state("recover", build_recovery(ctx), RECOVERY_TRANSITIONS)
    return machine
