"""Minimum jerk as feedback: the motion of a hand to its end, from any position, velocity and acceleration.

Flash and Hogan (1985); as a linear system of the remaining distance and time: Hoff and Arbib (1993). A change of
the end changes the motion without a step, as when people correct a reach.
"""

from __future__ import annotations

import numpy as np

POSITION, VELOCITY, ACCELERATION, END = range(4)


def transition(remaining: np.ndarray, step: np.ndarray) -> np.ndarray:
    """(..., 4, 4): transition of the state (m, m/s, m/s^2, end in m) over ``step`` s, ``remaining`` s before the end.

    Both have the same shape. A motion that ends within the step rests at its end. A step <= 0 changes nothing.
    """
    over = step >= remaining - 1e-9
    left = np.where(over, 1.0, remaining)
    x = np.clip(np.where(over, 0.0, step / left), 0.0, 1.0)
    result = np.zeros((*x.shape, 4, 4))
    result[..., END, END] = 1.0
    x2, x3, x4 = x**2, x**3, x**4
    # Quintic in x with the boundary values; each entry is the contribution of one boundary value or its derivatives.
    way = 10 * x3 - 15 * x4 + 6 * x4 * x, 30 * x2 - 60 * x3 + 30 * x4, 60 * x - 180 * x2 + 120 * x3
    speed = x - 6 * x3 + 8 * x4 - 3 * x4 * x, 1 - 18 * x2 + 32 * x3 - 15 * x4, -36 * x + 96 * x2 - 60 * x3
    bend = (
        0.5 * x2 - 1.5 * x3 + 1.5 * x4 - 0.5 * x4 * x,
        x - 4.5 * x2 + 6 * x3 - 2.5 * x4,
        1 - 9 * x + 18 * x2 - 10 * x3,
    )
    for order in range(3):
        result[..., order, POSITION] = float(order == 0) - way[order] / left**order
        result[..., order, VELOCITY] = speed[order] * left ** (1 - order)
        result[..., order, ACCELERATION] = bend[order] * left ** (2 - order)
        result[..., order, END] = way[order] / left**order
    rest = np.zeros((4, 4))
    rest[POSITION, END] = rest[END, END] = 1.0
    result[over] = rest
    return result
