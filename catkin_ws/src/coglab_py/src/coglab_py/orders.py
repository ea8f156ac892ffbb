"""Orders of conditions for one participant: balanced Latin square, random, or as listed."""

from __future__ import annotations

import random
from collections.abc import Sequence


def latin_row(conditions: Sequence[str], number: int) -> list[str]:
    """One row of a balanced Latin square (Williams design).

    Over n rows (n even) or 2n rows (n odd), each condition follows each other one equally often."""
    n = len(conditions)
    first = [0]
    for step in range(1, n):
        first.append((step + 1) // 2 if step % 2 else n - step // 2)
    row = [(value + number) % n for value in first]
    if n % 2 and (number // n) % 2:
        row.reverse()
    return [conditions[index] for index in row]


def order_of(conditions: Sequence[str], blocks: int, order: str, number: int) -> list[str]:
    """The conditions of all blocks, one after the other. A block holds each condition once.

    ``order``: "latin_square", "random", or anything else: as listed. ``number``: of the participant; it selects the
    row of the square, and is the seed of a random order."""
    chance = random.Random(number)
    listed: list[str] = []
    for block in range(blocks):
        if order == "latin_square":
            listed += latin_row(conditions, number + block)
        elif order == "random":
            listed += chance.sample(list(conditions), len(conditions))
        else:
            listed += conditions
    return listed
