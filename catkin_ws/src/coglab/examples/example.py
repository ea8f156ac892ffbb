"""Common parts of the numbered examples: arguments, files of the robot, folder of the plot."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from coglab_py.packages import package_path
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

URDF = package_path("lwr_description", "urdf", "lwr_ih2.urdf")
LIMITS = package_path("lwr_description", "config", "joint_limits.yaml")
PRIMITIVES = package_path("coglab_controllers", "config", "primitives.xml")


def parser(description: str | None) -> argparse.ArgumentParser:
    """A parser with --out, the folder of the plot. An example adds its own arguments."""
    arguments = argparse.ArgumentParser(description=description)
    arguments.add_argument(
        "--out", type=Path, default=Path("out/examples"), metavar="FOLDER", help="of the plot (default out/examples)"
    )
    return arguments


def new_figure(width: float = 7.0, height: float = 5.0) -> Figure:
    """A figure of this size (inch) that belongs to no window."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, script: str, out: Path) -> None:
    """Write the figure as NAME_OF_SCRIPT.png into the folder, and print its path."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{Path(script).stem}.png"
    figure.savefig(path, dpi=100)
    print(f"plot: {path}")


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    """Returns the share of the path at the share u of the time."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
