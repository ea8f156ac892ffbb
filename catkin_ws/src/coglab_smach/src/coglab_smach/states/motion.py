"""Ending motions: the state that started a motion ends it before anything else begins; shifts of the palm."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from coglab_controllers import rotation_between

from coglab_smach.context.context import Context
from coglab_smach.kinematics.motion_time import ptp_time
from coglab_smach.kinematics.reachability import damped_step, default_arm
from coglab_smach.ports.pending import Pending, PortError

POLL_PERIOD = 0.01  # s between two polls of a condition; contact must be detected within 60 ms
LINEAR = 0.03  # m, longest part of a way for which one step of the Jacobian is exact enough (2 mm)
SILENCE = 0.5  # s, time limit for a silent robot; the request stays in force


def end_motion(ctx: Context, reason: str) -> str:
    """End every motion of the arm and wait until its set-point and the arm stand still. Returns '' on success, else the
    reason.

    It ignores preemption and STOP, because both use it. Each wait takes at most ``motion.end_timeout`` s. If cancelling
    fails although the robot answers, the last resort is ``hold``: the arm brakes and latches, and the operator sees it.
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
    """Wait until no joint has moved by more than 1 mrad for 0.2 s, at most 1.5 s: the arm sways slightly after its
    set-point has stopped. ``look`` is called at each poll; a true result ends the wait."""
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
    """Start shift() by ``height`` m upward (negative: downward)."""
    return shift(ctx, np.array([0.0, 0.0, height]), speed)


def shift(ctx: Context, by: np.ndarray, speed: float) -> Pending | None:
    """Start a motion of the palm by ``by`` (m, base frame) without rotation. The speed is ``speed`` m/s, or less if a
    joint limit requires it; all joints move in proportion. None if the posture is unknown. Only with controller
    'ptp'."""
    here = ctx.arm.joint_positions()
    return None if here is None else ctx.arm.move_ptp(*_joint_way(ctx, here, by, speed))


def shift_time(ctx: Context, by: np.ndarray, speed: float) -> float:
    """Returns the duration (s) of shift() at full speed scale; 0 if the posture is unknown."""
    here = ctx.arm.joint_positions()
    return 0.0 if here is None else ptp_time(ctx.arm.motion_limits(), here, *_joint_way(ctx, here, by, speed))


def _joint_way(ctx: Context, here: Sequence[float], by: np.ndarray, speed: float) -> tuple[list[float], list[float]]:
    """Returns the joint positions after a shift (rad) and the joint speeds (rad/s)."""
    arm, begin, joints = default_arm(), np.asarray(here), np.asarray(here)
    place, posture = arm.fk(begin)
    steps = math.ceil(float(np.linalg.norm(by)) / LINEAR)
    for step in range(1, steps + 1):
        now, turned = arm.fk(joints)
        ahead, back = place + by * (step / steps) - now, rotation_between(turned, posture)
        joints = joints + damped_step(arm.jacobian(joints), ahead, back, 1e-4 * np.eye(6))
    way = joints - begin
    velocity = np.maximum(np.abs(way) * speed / float(np.linalg.norm(by)), 1e-3)
    # The controller refuses speeds above a limit. Slow all joints by the same factor, so that the path stays straight.
    share = float(np.min(np.asarray(ctx.arm.motion_limits().velocity) / velocity))
    return joints.tolist(), (velocity * min(1.0, share)).tolist()


def _await(ctx: Context, pending: Pending) -> str:
    """Returns the reason why the call failed; empty on success."""
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
