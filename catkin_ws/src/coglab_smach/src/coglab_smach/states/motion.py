"""The end of a motion: whoever started one ends it before anything else begins."""
from __future__ import annotations

from ..context import Context
from ..pending import Pending, PortError

POLL_PERIOD = 0.01
"""s"""
SILENCE = 0.5
"""s that a robot that says nothing is waited for; the request stays in force"""


def end_motion(ctx: Context, reason: str) -> str:
    """End every motion of the arm and wait until its set-point stands; returns why it does not, empty if it does.

    Deaf to preemption and STOP, because this is how both are obeyed; each wait takes ``motion.end_timeout`` s at most.
    Where cancelling fails although the robot is there, the last means is ``hold``: the arm brakes and latches, and the
    operator sees it.
    """
    trouble = _await(ctx, ctx.arm.cancel_motion(reason))
    if not trouble:
        return ""
    if ctx.arm.joint_positions() is None:
        return f"the motion could not be ended: {trouble}"
    held = _await(ctx, ctx.arm.hold(f"cancelling failed: {trouble}"))
    return f"the motion could not be cancelled ({trouble}), so the arm was held{f': {held}' if held else ''}"


def _await(ctx: Context, pending: Pending) -> str:
    """Why the call did not succeed; empty if it did."""
    limit = float(ctx.config.get("motion.end_timeout", 3.0))
    begin = ctx.clock.now()
    while not pending.done():
        if ctx.clock.now() - begin >= (SILENCE if ctx.arm.joint_positions() is None else limit):
            return "the robot is silent" if ctx.arm.joint_positions() is None else f"no answer within {limit:.1f} s"
        ctx.clock.sleep(POLL_PERIOD)
    try:
        pending.result()
    except PortError as error:
        return error.sentence
    return ""
