"""coglab_init_system: initialises perception and robot in parallel (D4.10, Figures 3 and 4)."""

from __future__ import annotations

from coglab_smach.context.context import Context
from coglab_smach.states.arm import ConfigureLwr, HomeRobot, LoadControllers, LoadDmps
from coglab_smach.states.base import CoglabConcurrence, CoglabMachine, require_all
from coglab_smach.states.hand import CalibrateHand
from coglab_smach.states.hub import WaitForTrigger
from coglab_smach.states.knowledge import InitVision


def build_calibrate_and_home(ctx: Context) -> CoglabConcurrence:
    """Calibrates the hand while the arm moves to its home posture."""
    decide, conclude = require_all(["hand_calibration", "coglab_home_robot"])
    group = CoglabConcurrence(
        ctx, "calibrate_and_home", ["succeeded", "failed", "preempted"], "failed", decide, conclude
    )
    with group:
        group.add_state("hand_calibration", CalibrateHand(ctx))
        group.add_state("coglab_home_robot", HomeRobot(ctx))
    return group


def build_init_robot(ctx: Context) -> CoglabMachine:
    """coglab_init_robot: plug-ins, primitives, LWR, trigger, then calibration and home in parallel (Figure 4)."""
    machine = CoglabMachine(ctx, "coglab_init_robot", ["succeeded", "failed", "preempted"])
    with machine:
        machine.add_state("load_controllers", LoadControllers(ctx), {"succeeded": "load_dmps"})
        machine.add_state("load_dmps", LoadDmps(ctx), {"succeeded": "configure_lwr"})
        machine.add_state("configure_lwr", ConfigureLwr(ctx), {"succeeded": "wait_trigger"})
        machine.add_state("wait_trigger", WaitForTrigger(ctx), {"succeeded": "calibrate_and_home"})
        machine.add_state("calibrate_and_home", build_calibrate_and_home(ctx), {"succeeded": "succeeded"})
    return machine


def build_init_system(ctx: Context) -> CoglabConcurrence:
    """coglab_init_system: coglab_init_vision and coglab_init_robot in parallel."""
    decide, conclude = require_all(["coglab_init_vision", "coglab_init_robot"])
    group = CoglabConcurrence(
        ctx, "coglab_init_system", ["succeeded", "failed", "preempted"], "failed", decide, conclude
    )
    group.is_action = True
    with group:
        group.add_state("coglab_init_vision", InitVision(ctx))
        group.add_state("coglab_init_robot", build_init_robot(ctx))
    return group
