"""Seeded curves for the imitation bench: straight, curved, looped and with a start speed."""

import numpy as np
from core_bench import minimum_jerk

SAMPLES = 501
KINDS = ("straight", "curved", "looped", "moving_start", "handwriting")


def curve(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Positions (SAMPLES, 3) in m of one curve of 1 s."""
    u = np.linspace(0.0, 1.0, SAMPLES)
    m = minimum_jerk(u)
    goal = rng.uniform(-0.5, 0.5, 3)
    goal *= rng.uniform(0.2, 0.6) / np.linalg.norm(goal)
    path = np.outer(m, goal)
    sides = rng.normal(size=(3, 3))
    if kind == "straight":
        return path
    if kind == "curved":
        path += 0.15 * np.outer(np.sin(np.pi * m), sides[0]) + 0.05 * np.outer(np.sin(2 * np.pi * m), sides[1])
        return path
    if kind == "looped":
        turns, radius = rng.integers(1, 3), rng.uniform(0.05, 0.15)
        angle = 2.0 * np.pi * turns * m
        one, two = np.linalg.qr(sides)[0][:, :2].T
        return path + radius * (np.outer(np.cos(angle) - 1.0, one) + np.outer(np.sin(angle), two))
    if kind == "moving_start":
        velocity = rng.uniform(-0.6, 0.6, 3)
        path += np.outer(u * (1.0 - u) ** 3, velocity) + 0.1 * np.outer(np.sin(np.pi * m), sides[0])
        return path
    # Strokes of random size that blend into each other, begun in motion, as pens do.
    points = np.cumsum(rng.normal(scale=0.08, size=(5, 3)), axis=0)
    times = np.linspace(-0.15, 0.85, 6)[:5]
    for point, before, time in zip(points, np.vstack([np.zeros(3), points[:-1]]), times, strict=True):
        path += np.outer(minimum_jerk((u - time) / 0.35), point - before)
    return path - path[0]


def curves(per_kind: int, seed: int = 11) -> list[tuple[str, np.ndarray]]:
    """`per_kind` curves of each kind."""
    rng = np.random.default_rng(seed)
    return [(kind, curve(kind, rng)) for kind in KINDS for _ in range(per_kind)]
