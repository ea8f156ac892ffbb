#!/usr/bin/python3
"""The simulated cell: time of a step, dynamics against MuJoCo's, a blocked arm, lockstep. Prints JSON rows only."""

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

import numpy as np

PACKAGE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PACKAGE / "test"))
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
BLOCKS, STEPS = 40, 2000


def lines_of(program: str) -> list[list[float]]:
    """What a timing program in the devel or install space on CMAKE_PREFIX_PATH prints, one list per block."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "lib" / "coglab_sim" / program
        if path.is_file():
            output = subprocess.run(
                [str(path), str(URDF), str(BLOCKS), str(STEPS)], check=True, capture_output=True, text=True, timeout=600
            ).stdout
            return [[float(word) for word in line.split()] for line in output.splitlines()]
    sys.exit(f"{program} not found: build the package and source its setup.bash first")


def equality() -> float | None:
    """Largest relative difference to MuJoCo over 1000 random states; None without the oracle."""
    try:
        import mujoco  # noqa: F401
    except ImportError:
        return None
    from coglab_sim import _cell
    from test_dynamics_oracle import Oracle

    oracle, random, worst = Oracle(), np.random.default_rng(1), 0.0
    for _ in range(1000):
        position, velocity = random.uniform(-2.0, 2.0, 7), random.uniform(-2.0, 2.0, 7)
        theirs, ours = oracle.terms(position, velocity), _cell.arm_terms(str(URDF), position, velocity)
        for name in ("mass", "gravity", "coriolis", "jacobian"):
            scale = max(1.0, np.abs(theirs[name]).max())
            worst = max(worst, np.abs(ours[name] - theirs[name]).max() / scale)
    return float(worst)


def row(figure: str, value: float, unit: str, limit: float) -> dict[str, object]:
    """A figure without a peer; fine up to `limit`."""
    return {
        "bench": "dynamics",
        "figure": figure,
        "value": value,
        "unit": unit,
        "goal": f"<= {limit:g}",
        "peer": None,
        "peer_value": None,
        "ok": value <= limit,
    }


def blocked_rows() -> list[dict[str, object]]:
    """Bridge and cell: the moving arm is held for 5 s and released; worst of two motions and three periods."""
    from wire import BLOCKED_MODES, BLOCKED_MOTIONS, Wire, speed_after_block

    return [
        row(
            f"{mode}: peak speed after 5 s against a block",
            round(
                max(
                    speed_after_block(Wire(krc__period=period), mode, moving)
                    for moving in BLOCKED_MOTIONS
                    for period in (0.001, 0.005, 0.02)
                ),
                5,
            ),
            "rad/s",
            0.1,
        )
        for mode in BLOCKED_MODES
    ]


def lockstep_row() -> dict[str, object]:
    """Two runs with the same seed, byte by byte."""
    from wire import lockstep_bytes

    periods = 3000
    first, second = lockstep_bytes(6, periods), lockstep_bytes(6, periods)
    different = sum(a != b for a, b in zip(first, second, strict=True))
    return row(f"lockstep: datagrams that differ between two runs of {periods} periods", different, "datagrams", 0)


def step_rows() -> list[dict[str, object]]:
    """A complete step of the cell beside MuJoCo alone on the same model and states, in the same blocks."""
    cell, mujoco, terms, contacts = zip(*lines_of("coglab_sim_bench_cell"), strict=True)
    ratio = statistics.median(a / b for a, b in zip(cell, mujoco, strict=True))
    figure = f"1 ms step of the cell over mj_step, median ratio, at least {min(contacts):.0f} contacts"
    return [
        {
            "bench": "dynamics",
            "figure": figure,
            "value": round(ratio, 3),
            "unit": "ratio",
            "goal": "<= 1.3",
            "peer": "mj_step alone, us",
            "peer_value": round(statistics.median(mujoco) * 1e-3, 2),
            "ok": ratio <= 1.3 and min(contacts) >= 4,
        },
        {
            "bench": "dynamics",
            "figure": "1 ms step of the cell, median processor time",
            "value": round(statistics.median(cell) * 1e-3, 2),
            "unit": "us",
            "goal": "printed",
            "peer": "KDL terms of the controller alone",
            "peer_value": round(statistics.median(terms) * 1e-3, 2),
            "ok": True,
        },
    ]


def main() -> None:
    rows = step_rows()
    difference = equality()
    if difference is None:
        print("no row for the comparison with MuJoCo: mujoco-core is not installed", file=sys.stderr)
    else:
        rows.append(
            {
                "bench": "dynamics",
                "figure": "M, C, g, J against MuJoCo, 1000 random states, largest difference",
                "value": difference,
                "unit": "relative",
                "goal": "<= 1e-9",
                "peer": None,
                "peer_value": None,
                "ok": difference <= 1e-9,
            }
        )
    rows += blocked_rows() + [lockstep_row()]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
