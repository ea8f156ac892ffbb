"""Minimum jerk as feedback: the motion of a hand to its end, from any position, velocity and acceleration.

Flash and Hogan (1985); as a linear system of the remaining distance and time: Hoff and Arbib (1993). A change of
the end changes the motion without a step, as when people correct a reach.
"""

from __future__ import annotations

import numpy as np

POSITION, VELOCITY, ACCELERATION, END = range(4)


def transition(remaining: np.ndarray, step: np.ndarray) -> np.ndarray:
    """(3, 4, ...): position, velocity and acceleration (m, m/s, m/s^2) after ``step`` s, from position, velocity,
    acceleration and end (m), ``remaining`` s before the end. The end does not change.

    Both times have the same shape (...). A motion that ends within the step rests at its end. A step <= 0 changes
    nothing.
    """
    over = step >= remaining - 1e-9
    left = np.where(over, 1.0, remaining)
    x = np.where(over, 1.0, np.maximum(step, 0.0) / left)
    x2 = x * x
    x3, x4 = x2 * x, x2 * x2
    x5 = x4 * x
    result = np.empty((3, 4, *x.shape))
    # Quintic in x with the boundary values; each entry is the contribution of one boundary value or its derivatives.
    way = 10 * x3 - 15 * x4 + 6 * x5, (30 * x2 - 60 * x3 + 30 * x4) / left, (60 * x - 180 * x2 + 120 * x3) / left**2
    for order in range(3):
        result[order, POSITION] = float(order == 0) - way[order]
        result[order, END] = way[order]
    result[0, VELOCITY] = (x - 6 * x3 + 8 * x4 - 3 * x5) * left
    result[1, VELOCITY] = 1 - 18 * x2 + 32 * x3 - 15 * x4
    result[2, VELOCITY] = (-36 * x + 96 * x2 - 60 * x3) / left
    result[0, ACCELERATION] = (0.5 * x2 - 1.5 * x3 + 1.5 * x4 - 0.5 * x5) * left**2
    result[1, ACCELERATION] = (x - 4.5 * x2 + 6 * x3 - 2.5 * x4) * left
    result[2, ACCELERATION] = 1 - 9 * x + 18 * x2 - 10 * x3
    return result
