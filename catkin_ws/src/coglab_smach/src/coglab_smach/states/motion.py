"""The end of a motion: whoever started one ends it before anything else begins."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from coglab_smach.context.context import Context
from coglab_smach.kinematics.motion_time import ptp_time
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError

POLL_PERIOD = 0.01  # s
SILENCE = 0.5  # s that a robot that says nothing is waited for; the request stays in force


def end_motion(ctx: Context, reason: str) -> str:
    """End every motion of the arm and wait until its set-point stands, and the arm with it; returns why it does not,
    empty if it does.

    Deaf to preemption and STOP, because this is how both are obeyed; each wait takes ``motion.end_timeout`` s at most.
    Where cancelling fails although the robot is there, the last means is ``hold``: the arm brakes and latches, and the
    operator sees it.
    """
    trouble = _await(ctx, ctx.arm.cancel_motion(reason))
    if not trouble:
        await_rest(ctx)
        return ""
    if ctx.arm.joint_positions() is None:
        return f"the motion could not be ended: {trouble}"
    held = _await(ctx, ctx.arm.hold(f"cancelling failed: {trouble}"))
    await_rest(ctx)
    return f"the motion could not be cancelled ({trouble}), so the arm was held{f': {held}' if held else ''}"


def await_rest(ctx: Context, look: Callable[[], object] = lambda: None) -> None:
    """Until no joint has moved by more than 1 mrad for 0.2 s, or 1.5 s are over: the arm sways a little after its
    set-point has come to rest. ``look`` is called all the while; what it returns ends the wait if it is true."""
    end = ctx.clock.now() + 1.5
    still_since, place = ctx.clock.now(), ctx.arm.joint_positions()
    while ctx.clock.now() < end and ctx.clock.now() - still_since < 0.2:
        if look():
            return
        ctx.clock.sleep(POLL_PERIOD)
        now = ctx.arm.joint_positions()
        if now is None or place is None or max(abs(a - b) for a, b in zip(now, place, strict=True)) > 0.001:
            still_since, place = ctx.clock.now(), now


def rise(ctx: Context, height: float, speed: float) -> Pending | None:
    """shift() up by ``height`` m, down if negative."""
    return shift(ctx, np.array([0.0, 0.0, height]), speed)


def shift(ctx: Context, by: np.ndarray, speed: float) -> Pending | None:
    """Begin to move the palm ``by`` (m, base frame) without turning it, at ``speed`` m/s or as fast as the limits let
    it, each joint as fast as its share of the way asks for; None where the posture is not known. Only with controller
    'ptp'."""
    here = ctx.arm.joint_positions()
    return None if here is None else ctx.arm.move_ptp(*_joint_way(ctx, here, by, speed))


def shift_time(ctx: Context, by: np.ndarray, speed: float) -> float:
    """s that shift() takes at full speed scale; 0 where the posture is not known."""
    here = ctx.arm.joint_positions()
    return 0.0 if here is None else ptp_time(ctx.arm.motion_limits(), here, *_joint_way(ctx, here, by, speed))


def _joint_way(ctx: Context, here: Sequence[float], by: np.ndarray, speed: float) -> tuple[list[float], list[float]]:
    """Where the joints are after a shift (rad), and how fast each goes there (rad/s)."""
    jacobian = default_arm().jacobian(np.asarray(here))
    twist = np.concatenate([by, np.zeros(3)])
    way = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), twist)
    velocity = np.maximum(np.abs(way) * speed / float(np.linalg.norm(by)), 1e-3)
    # Beyond a limit the motion would be refused: all joints are slowed down alike, so that the way stays straight.
    share = float(np.min(np.asarray(ctx.arm.motion_limits().velocity) / velocity))
    return (np.asarray(here) + way).tolist(), (velocity * min(1.0, share)).tolist()


def _await(ctx: Context, pending: Pending) -> str:
    """Why the call did not succeed; empty if it did."""
    limit = ctx.config.number("motion.end_timeout")
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
