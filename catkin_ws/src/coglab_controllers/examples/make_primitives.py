#!/usr/bin/python3
"""Learns the primitives of config/primitives.xml from synthetic demonstrations and writes the file.

Usage: make_primitives.py [FILE]

The motions consist of minimum-jerk pieces (Flash and Hogan 1985): people react earlier to such a hand than to one with
a trapezoidal speed (Huber et al. 2008).
"""

import sys

import coglab_controllers as cc
import numpy as np

SAMPLES = 241


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    """Share of the way at share u of the time; rests before 0 and after 1."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def lift(u: np.ndarray) -> np.ndarray:
    """A bump of height 1 that begins and ends at rest, without acceleration."""
    u = np.clip(u, 0.0, 1.0)
    return 64.0 * u**3 * (1.0 - u) ** 3


def demonstrations() -> list[tuple[str, str, str, np.ndarray, np.ndarray]]:
    """Name, description, shape mapping, times (n,) in s and positions (n, 3) in m of each primitive."""
    u = np.linspace(0.0, 1.0, SAMPLES)
    zero = np.zeros(SAMPLES)
    straight = np.stack([0.5 * minimum_jerk(u), zero, zero], axis=1)
    # To a hand held high: from below, so that the person sees all of the robot's hand while it comes.
    high = np.stack([0.5 * minimum_jerk(u), zero, -0.04 * lift(u)], axis=1)
    # To the board: forward first, down last, so that the hand comes from above.
    take = np.stack([0.4 * minimum_jerk(u / 0.8), zero, 0.06 * lift(u) - 0.2 * minimum_jerk((u - 0.25) / 0.75)], axis=1)
    put = np.stack([0.4 * minimum_jerk(u / 0.75), zero, 0.10 * lift(u) - 0.2 * minimum_jerk((u - 0.3) / 0.7)], axis=1)
    return [
        ("reach_human", "Straight reach to a person's hand, to take an object.", "similarity", 1.2 * u, straight),
        ("reach_human_high", "Reach to an object held high: from below.", "upright", 1.2 * u, high),
        ("give_human", "Straight reach to a person's hand, to give an object.", "similarity", 1.2 * u, straight),
        ("take_board", "Over to an object on the board and down to it from above.", "upright", 2.0 * u, take),
        ("put_board", "Over to a free place on the board and down to it from above.", "upright", 2.2 * u, put),
    ]


def main() -> None:
    """Learns, writes and reports the error of each reproduction."""
    library = cc.Library()
    for name, description, mapping, times, positions in demonstrations():
        primitive = cc.learn(name, [(times, positions)], basis_count=20, mapping=mapping)
        primitive.description = description
        error = np.linalg.norm(cc.reproduce(primitive, times) - positions, axis=1)
        print(f"{name}: {primitive.duration:.1f} s, worst deviation {1000 * error.max():.2f} mm")
        library.add(primitive)
    library.save(sys.argv[1] if len(sys.argv) > 1 else "primitives.xml")


if __name__ == "__main__":
    main()
