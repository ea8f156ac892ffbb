"""What the benches of the cores share: rows, files of the workspace, minimum-jerk reaches."""

import json
import operator
import os
import subprocess
from pathlib import Path

import numpy as np

PACKAGE = Path(__file__).resolve().parent.parent
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
PRIMITIVES = PACKAGE / "config" / "primitives.xml"

Row = dict[str, str | float | bool | None]


def row(
    bench: str,
    figure: str,
    value: float,
    unit: str,
    goal: str = "",
    peer: str | None = None,
    peer_value: float | None = None,
    below_peer: bool = False,
) -> Row:
    """One row; `goal` is "" (reported only), "<= number", "< number" or ">= number"; `below_peer` also asks to beat the
    peer, which nobody does where the peer is not there."""
    ok = True
    if goal:
        sign, number = goal.split()
        ok = {"<=": operator.le, "<": operator.lt, ">=": operator.ge}[sign](value, float(number))
    if below_peer:
        ok = ok and peer_value is not None and value < peer_value
        goal = f"{goal}, < peer" if goal else "< peer"
    return {
        "bench": bench,
        "figure": figure,
        "value": round(float(value), 6),
        "unit": unit,
        "goal": goal or "reported",
        "peer": peer,
        "peer_value": None if peer_value is None else round(float(peer_value), 6),
        "ok": bool(ok),
    }


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    """Share of the way at share u of the time."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def core_times() -> dict[str, float]:
    """Runs the C++ helper; microseconds per call by name. Raises FileNotFoundError if it is not built."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        helper = Path(prefix) / "lib" / "coglab_controllers" / "core_times"
        if helper.is_file():
            output = subprocess.run(
                [str(helper), str(URDF), str(PRIMITIVES)], check=True, capture_output=True, text=True, timeout=300
            ).stdout
            return json.loads(output)
    raise FileNotFoundError("core_times is not built: build coglab_controllers and source the devel environment")
