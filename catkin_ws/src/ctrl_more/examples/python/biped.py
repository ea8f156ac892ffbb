#!/usr/bin/env python3
"""Biped: a central module with a locomotor in Python and three shipped feedback controllers, under pushes.

A short push, on a robot that can place its ZMP:
    dcm    the ZMP follows the divergent component of motion (ZmpDcm, mode dcm)
A long push, on a robot whose centre of mass follows its reference stiffly:
    lean   leans against the push until the ZMP is back in the middle of the feet (ZmpDcm, mode zmp_ip)
    yield  gives way like a spring and comes back (CompliantStabiliser)

    biped.py [--plot FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from ctrl_more import CentralModule, ControlStates, Cycle, RobotStates, register_manager
from plants import Biped

CENTRAL = Path(__file__).with_suffix(".yaml")
DT = 0.005  # s
SHORT = (0.5, 0.6, 130.0)  # push from s, to s, N
LONG = (1.0, 5.0, 20.0)
CASES = {  # name: controller, the reference that the robot follows, push
    "short push, no feedback": ("", "zmp", SHORT),
    "short push, dcm": ("dcm", "zmp", SHORT),
    "long push, no feedback": ("", "com", LONG),
    "long push, lean": ("lean", "com", LONG),
    "long push, yield": ("yield", "com", LONG),
}


class Locomotor:
    """Manager of a standing robot. Task stage: references. Joint stage: whole-body control, which places the ZMP."""

    def __init__(self, name: str, block: dict[str, Any], robot: RobotStates, control: ControlStates) -> None:
        self.follows = block["follows"]  # which reference: zmp or com
        self.omega = Biped().omega
        control.declare("otherReference", "foothold", 3, "m", "world")

    def update_stage(self, stage: str, robot: RobotStates, control: ControlStates) -> None:
        if stage == "task":  # stand still over the middle of the feet
            control.set_com([0, 0, 0.8])
            control.set_com_velocity([0, 0, 0])
            control.set_zmp([0, 0, 0])
            return
        foothold = control.get_zmp()
        if self.follows == "com":
            com = robot.get_estimated_data("com")
            away, drift = control.get_com() - com[:3], control.get_com_velocity() - com[3:]
            acceleration = 100.0 * away + 20.0 * drift  # critically damped, 10 1/s
            foothold = com[:3] - acceleration / self.omega**2  # a ZMP behind the centre of mass drives it on
        control.set_other_reference("foothold", foothold)


register_manager("Locomotor", Locomotor)


def run(controller: str, follows: str, push: tuple[float, float, float]) -> dict[str, npt.NDArray[np.float64]]:
    """Stand for 8 s. Returns t (s), com, zmp (m, along x) and fallen (0 or 1)."""
    begin, end, force = push
    central = CentralModule(CENTRAL)
    central.manager("locomotor").follows = follows
    if controller:
        central.feedback_controllers().enable(controller)
    robot, biped, rows = central.robot_states(), Biped(), []
    for number in range(1, round(8.0 / DT) + 1):
        t = number * DT
        now_ns = round(t * 1e9)
        robot.set_estimated_data("com", biped.com, now_ns)
        robot.set_estimated_data("zmp", biped.zmp, now_ns)
        central.update(Cycle(now_ns, DT, number))
        foothold = central.control_states().get_other_reference("foothold")
        biped.step(foothold, [force if begin <= t < end else 0.0, 0.0], DT)
        rows.append((t, biped.position[0], biped.zmp[0], biped.fallen))
    return dict(zip(("t", "com", "zmp", "fallen"), np.array(rows, dtype=float).T, strict=True))


def plot(runs: dict[str, dict[str, npt.NDArray[np.float64]]], file: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.8), layout="constrained")
    for axes, word, (begin, end, force) in zip(figure.subplots(1, 2), ("short", "long"), (SHORT, LONG), strict=True):
        axes.axhspan(-0.1, 0.1, color="0.93")
        axes.axvspan(begin, end, color="C1", alpha=0.25, label=f"push of {force:.0f} N")
        chosen = [(name, one) for name, one in runs.items() if name.startswith(word)]
        for (name, one), colour in zip(chosen, ("C3", "C0", "C2"), strict=False):
            up = one["fallen"] == 0.0
            axes.plot(one["t"][up], one["com"][up], colour, label=f"{name.partition(', ')[2]}: centre of mass")
            axes.plot(one["t"][up], one["zmp"][up], colour, lw=0.8, ls="--")
        axes.set(xlabel="time [s]", ylabel="x [m] (dashed: ZMP, grey: feet)", ylim=(-0.13, 0.2), title=f"A {word} push")
        axes.legend(fontsize=8)
    figure.savefig(file, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plot", type=Path, metavar="FILE", help="write a figure, such as biped.png")
    options = parser.parse_args()
    runs = {name: run(*case) for name, case in CASES.items()}
    for name, one in runs.items():
        if one["fallen"][-1]:
            print(f"{name}: falls {one['t'][one['fallen'] == 1.0][0] - SHORT[0]:.1f} s after the push begins")
            continue
        at = round(LONG[1] / DT) - 2  # the end of the long push
        most, com, zmp = (1000 * x for x in (abs(one["com"]).max(), one["com"][at], one["zmp"][at]))
        print(f"{name}: stands, moves {most:.0f} mm at most; at 5 s it is at {com:.0f} mm, its ZMP at {zmp:.0f} mm")
    if options.plot:
        plot(runs, options.plot)


if __name__ == "__main__":
    main()
