#!/usr/bin/python3
"""Imitation error and step time of the DMP beside PyPI movement_primitives (if it is there).

44 curves of each of five kinds (curves.py), 20 basis functions on both sides, begun with the same velocity. Error: root
mean square over the samples of a curve, in percent of its length; the median over all curves, none left out. Step:
median time of a call.
"""

import json
import sys
import time

import coglab_controllers as cc
import numpy as np
from core_bench import Row, core_times, row
from curves import SAMPLES, curves

try:
    from movement_primitives.dmp import DMP
except ImportError:  # the peer is optional: its column is then null
    DMP = None

PEER = "movement_primitives" if DMP is not None else None
BASIS = 20
TIMES = np.linspace(0.0, 1.0, SAMPLES)


def relative_rmse(path: np.ndarray, wanted: np.ndarray) -> float:
    """RMSE in percent of the path's length."""
    length = np.linalg.norm(np.diff(wanted, axis=0), axis=1).sum()
    return 100.0 * float(np.sqrt(np.mean(np.sum((path - wanted) ** 2, axis=1)))) / length


def ours(wanted: np.ndarray, every: int = 1) -> float:
    """Error of our reproduction, start velocity kept, stepped from each `every`-th sample to the next."""
    primitive = cc.learn("curve", [(TIMES, wanted)], basis_count=BASIS)
    path = cc.reproduce(primitive, TIMES[::every], 1.0)
    return relative_rmse(path, wanted[::every])


def theirs(wanted: np.ndarray) -> float:
    """Error of the peer with as many basis functions, begun with the same velocity."""
    dt = 1.0 / (SAMPLES - 1)
    dmp = DMP(n_dims=3, execution_time=1.0, dt=dt, n_weights_per_dim=BASIS)
    dmp.imitate(TIMES, wanted)
    velocity = (wanted[1] - wanted[0]) / dt
    dmp.configure(start_y=wanted[0], goal_y=wanted[-1], start_yd=velocity)
    _, path = dmp.open_loop(run_t=1.0)
    return relative_rmse(path[:SAMPLES], wanted)


def peer_step_time() -> float:
    """Median time of the peer's step, us."""
    dmp = DMP(n_dims=3, execution_time=1.0, dt=0.005, n_weights_per_dim=BASIS)
    dmp.configure(start_y=np.zeros(3), goal_y=np.ones(3))
    position, velocity, spent = np.zeros(3), np.zeros(3), []
    for _ in range(150):
        begin = time.perf_counter()
        position, velocity = dmp.step(position, velocity)
        spent.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(spent))


def imitation_rows() -> list[Row]:
    """Errors over all curves and per kind."""
    wanted = curves(44)
    errors = np.array([ours(path) for _, path in wanted])
    at_cycle = np.array([ours(path, every=5) for _, path in wanted])
    peer = np.array([theirs(path) for _, path in wanted]) if DMP else None
    rows = [
        row(
            "dmp",
            f"imitation RMSE, median of {len(wanted)} curves, N=20",
            np.median(errors),
            "% of path",
            "<= 0.10",
            PEER,
            None if peer is None else np.median(peer),
            below_peer=True,
        ),
        row(
            "dmp",
            f"imitation RMSE, 95th percentile of {len(wanted)} curves, N=20",
            np.percentile(errors, 95),
            "% of path",
            "",
            PEER,
            None if peer is None else np.percentile(peer, 95),
            below_peer=True,
        ),
        row(
            "dmp",
            f"imitation RMSE, stepped at 100 Hz, median of {len(wanted)} curves, N=20",
            np.median(at_cycle),
            "% of path",
            "<= 0.10",
        ),
    ]
    for kind in dict.fromkeys(kind for kind, _ in wanted):
        chosen = np.array([k == kind for k, _ in wanted])
        rows.append(
            row(
                "dmp",
                f"imitation RMSE, median of {int(chosen.sum())} {kind} curves, N=20",
                np.median(errors[chosen]),
                "% of path",
                "",
                PEER,
                None if peer is None else np.median(peer[chosen]),
            )
        )
    return rows


def main() -> None:
    """Prints the rows as JSON."""
    rows = imitation_rows()
    peer = peer_step_time() if DMP else None
    words = "one step of a DMP, three axes, N=20, 200 Hz, median of all calls"
    rows.append(row("dmp", words, core_times()["dmp_step_20"], "us", "<= 0.5", PEER, peer))
    json.dump(rows, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
