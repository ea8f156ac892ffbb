"""What the numbered examples share: where the robot's files are, and where a plot goes."""

import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

PACKAGE = Path(__file__).resolve().parent.parent
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
PRIMITIVES = PACKAGE / "config" / "primitives.xml"


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    """Share of the way at share u of the time."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def save_plot(script: str) -> None:
    """Writes the current figure beside the script, or into the folder given as first argument."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(script).resolve().parent
    path = folder / (Path(script).stem + ".png")
    pyplot.tight_layout()
    pyplot.savefig(path, dpi=80)
    print(f"plot: {path}")
