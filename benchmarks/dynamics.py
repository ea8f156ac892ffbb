#!/usr/bin/python3
"""The simulated cell compared with MuJoCo alone, and its dynamics compared with KDL.

Step: processor time of a complete 1 ms step / that of mj_step on the same states, median of the blocks' ratios; a mug
is in the fingers. Difference: largest element of mass matrix, gravity, and Coriolis torques over 100 random states.
"""

from __future__ import annotations

import re
import statistics
import subprocess
from collections.abc import Iterator

from common import DEVEL, Row, helper, main


def step(quick: bool) -> Iterator[Row]:
    """Time of a step of the cell."""
    blocks = "5" if quick else "40"
    run = subprocess.run([helper("cell_step"), blocks, "2000"], check=True, capture_output=True, text=True, timeout=600)
    lines = [[float(word) for word in line.split()] for line in run.stdout.splitlines()]
    if min(contacts for *_, contacts in lines) < 4:
        raise RuntimeError("the mug was not in the hand: fewer than 4 contacts")
    ratio = statistics.median(cell / mujoco for cell, mujoco, _ in lines)
    yield Row("one step of the cell over bare MuJoCo", ratio, "", "<= 1.3", f"{blocks} blocks of 2000 steps")


def against_kdl(_quick: bool) -> Iterator[Row]:
    """The plant with all its fingers compared with a KDL tree, as printed by the package's test, if that is built."""
    for program in sorted((DEVEL / "lib" / "coglab_sim").glob("coglab_sim_test_*")):
        command = [str(program), "--gtest_filter=*Kdl*:*KDL*:PlantTerms*"]
        text = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False).stdout
        found = dict(re.findall(r"(?:difference to KDL:|  )\s*(M|C\+g|g|J) (\S+)", text))
        if {"M", "C+g", "g"} <= set(found):
            worst = max(float(found[name]) for name in ("M", "C+g", "g"))
            yield Row("dynamics of the plant against KDL, largest difference", worst, "SI", "<= 1e-06", "100 states")
            return
    print("not measured, not built: ./coglab test coglab_sim builds the test that compares with KDL")


if __name__ == "__main__":
    main("dynamics", step, against_kdl)
