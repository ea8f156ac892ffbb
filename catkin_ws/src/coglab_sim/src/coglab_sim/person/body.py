"""Arm of the simulated person, for pictures only: it has no contacts."""

from __future__ import annotations

import numpy as np

SHOULDER = np.array([1.42, 0.20, 0.50])  # m, world; the shoulder moves forward if the hand is out of reach
UPPER_ARM = 0.33  # m
FOREARM = 0.36  # m, up to the palm


def arm_of(hand: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns shoulder and elbow (m, world) for a palm at `hand` (m, world); the elbow points down."""
    away = SHOULDER - hand
    distance = float(np.linalg.norm(away))
    reach = min(distance, 0.98 * (UPPER_ARM + FOREARM))
    axis = away / distance if distance > 1e-6 else np.array([1.0, 0.0, 0.0])
    shoulder = hand + reach * axis
    along = (reach**2 + FOREARM**2 - UPPER_ARM**2) / (2.0 * max(reach, 1e-6))  # law of cosines
    aside = np.sqrt(max(FOREARM**2 - along**2, 0.0))
    down = np.array([0.0, 0.0, -1.0]) + axis[2] * axis
    return shoulder, hand + along * axis + aside * down / max(float(np.linalg.norm(down)), 1e-6)
