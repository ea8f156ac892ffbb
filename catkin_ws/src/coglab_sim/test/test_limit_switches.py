"""Limits under loss of datagrams, checked by the stand-in's software limit switches."""

import random

import lwr_fri_bridge as bridge_module
import numpy as np
import pytest
from wire import LIMITS, Wire

IN_A_ROW, OF_HUNDRED = 5, 20
"""most cycles that are lost, in a row and of any hundred (docs/limits_under_loss.md)"""
A2 = 1
"""index of the joint that leans the whole arm over"""


def losses(draw, share, bursts):
    """What each cycle loses: "", "measurement" or "answer"; one at a time or in bursts of 1 to 5."""
    mean = 3.0 if bursts else 1.0
    window, left, last = [], 0, False
    while True:
        if left == 0 and not last and draw.random() < share / (mean * (1.0 - share)):
            left = draw.randint(1, IN_A_ROW) if bursts else 1
        if sum(window[-99:]) >= OF_HUNDRED:
            left = 0
        last = left > 0
        left -= last
        window.append(last)
        yield draw.choice(("measurement", "answer")) if last else ""


def approach(period, share, bursts, seed, **cell):
    """One joint goes to one end of its range at full speed: limit switches, and whether it came within 0.06 rad of
    the end in command mode."""
    draw = random.Random(seed)
    limits = bridge_module.JointLimits(LIMITS)
    joint, side = seed % 7, 1.0 if seed % 14 < 7 else -1.0
    home = [draw.uniform(-0.6, 0.6) for _ in range(7)]
    if joint == A2:  # the forearm stays above the board
        home[2], home[3] = 0.0, 1.2 * side
    home[joint] = side * (limits.upper_position[joint] - draw.uniform(0.5, 1.2))
    wire = Wire(krc__period=period, home=home, **cell)
    wire.start()
    velocity, nearest = np.eye(7)[joint] * side * limits.velocity[joint], np.inf
    lost = losses(draw, share, bursts)
    for _ in range(round(1.6 / period)):
        what = next(lost)
        answer = None
        if what != "measurement" and wire.measurement is not None:
            answer = wire.bridge.answer(wire.measurement, wire.now)
        wire.bridge.send_velocity(velocity, wire.now)
        wire.measurement = wire.cell.step(None if what == "answer" else answer)
        wire.now += round(wire.cell.period * 1e9)
        nearest = min(nearest, limits.upper_position[joint] - side * wire.cell.set_point[joint])
    return wire.cell.limit_switches, bool(nearest < 0.06 and wire.cell.fri_state == 2)


@pytest.mark.parametrize("seed, period", [(1, 0.02), (8, 0.005), (3, 0.002)])
@pytest.mark.parametrize("bursts", [False, True])
def test_no_limit_switch_is_met_at_full_speed_while_datagrams_are_lost(seed, period, bursts):
    assert approach(period, 0.10, bursts, seed) == (0, True)


def test_limit_switch_within_the_range_ends_command_mode():
    switches = [limit - 0.05 for limit in bridge_module.JointLimits(LIMITS).upper_position]
    assert approach(0.005, 0.0, False, 1, krc__position_limit=switches) == (1, False)
