#!/usr/bin/python3
"""Figure `cycle`: the whole control cycle beside the same cycle on KDL's velocity solvers.

Times: median of all cycles of 150 blocks, which alternate between the three; the ratio is the median of the blocks' own
ratios to the faster solver. None is left out. Allocations, locks and system calls are counted by the package's test of
the cycle, run here, over 1e5 cycles with services called meanwhile; what could not be counted is missed. Prints a JSON
list of rows.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent.parent


def find(name: str) -> str:
    """A program of this package in the sourced workspace."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "lib" / "coglab_controllers" / name
        if path.exists():
            return str(path)
    found = shutil.which(name)
    if found:
        return found
    raise FileNotFoundError(
        f"{name}: not in any workspace of CMAKE_PREFIX_PATH; build "
        "coglab_controllers (tests too) and source its setup.bash"
    )


def row(
    figure: str, value: float | None, unit: str, goal: str, peer: str | None, peer_value: float | None, ok: bool
) -> dict:
    """One row of the result; a value of None was not measured."""
    return {
        "bench": "cycle",
        "figure": figure,
        "value": value,
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": peer_value,
        "ok": ok,
    }


COUNTED = {"allocations": "allocations", "locks": "locks", "system_calls": "system calls"}


def forbidden_calls() -> dict[str, int]:
    """What 1e5 free-running cycles did that they must not do, services called meanwhile; empty: not built."""
    try:
        program = find("coglab_controllers_test_cycle")
    except FileNotFoundError:
        return {}
    counts: dict[str, int] = {}
    with TemporaryDirectory() as folder:
        result = Path(folder) / "cycle.xml"
        subprocess.run(
            [program, "--gtest_filter=Cycle.Neither*", f"--gtest_output=xml:{result}"],
            stdout=sys.stderr,
            timeout=300,
            check=False,
        )
        cases = ElementTree.parse(result).iter("testcase")
        for case in cases:
            for prop in case.iter("property"):
                if prop.get("name") in COUNTED:
                    counts[prop.get("name", "")] = int(prop.get("value", "-1"))
    return counts


def main() -> int:
    """Runs the timings and prints the rows."""
    output = subprocess.run(
        [find("coglab_controllers_cycle_bench"), str(HERE), str(HERE.parent / "lwr_description")],
        stdout=subprocess.PIPE,
        timeout=300,
        check=True,
        text=True,
    ).stdout
    times = json.loads(output)
    ours, ratio = times["ours_us"], min(times["ratio_pinv"], times["ratio_wdls"])
    whole = "whole cycle, median of all cycles of 150 blocks"
    rows = [
        row(whole, ours, "us", "<= 5", "the same cycle on KDL pinv", times["kdl_pinv_us"], ours <= 5.0),
        row(whole, ours, "us", "<= 5", "the same cycle on KDL wdls", times["kdl_wdls_us"], ours <= 5.0),
        row(
            "whole cycle: times faster than on KDL (the faster solver), median of 150 block ratios",
            ratio,
            "x",
            ">= 2",
            "KDL",
            1.0,
            ratio >= 2.0,
        ),
    ]
    counts = forbidden_calls()
    for name, words in COUNTED.items():
        count = counts.get(name, -1)
        figure = f"{words} in 1e5 cycles, services called meanwhile"
        if count < 0:
            figure += "; could not be counted here"
        rows.append(row(figure, count if count >= 0 else None, "1", "<= 0", None, None, count == 0))
    print(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
