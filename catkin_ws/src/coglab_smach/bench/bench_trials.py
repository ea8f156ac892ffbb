#!/usr/bin/python3
"""Bench of whole trials in virtual time. 20 of each exchange and of take and put; 100 with COGLAB_LONG=1."""
import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import smach

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from virtual_ports import VirtualTrial

TRIALS = 100 if os.environ.get("COGLAB_LONG") == "1" else 20
HUMAN_BASE = 1.1
"""s, a person's reach over 0.45 m."""


def row(figure, value, unit, goal="", ok=True, peer=None, peer_value=None):
    """One row of the bench table."""
    return {"bench": "trials", "figure": figure, "value": round(float(value), 4), "unit": unit, "goal": goal,
            "peer": peer, "peer_value": peer_value if peer_value is None else round(float(peer_value), 4),
            "ok": bool(ok)}


def sparc(speed, rate, cut=10.0, amplitude=0.05):
    """Spectral arc length of a speed profile (Balasubramanian et al.), 10 Hz, amplitude threshold 0.05; 0 is
    smoothest."""
    n = int(2 ** (np.ceil(np.log2(len(speed))) + 4))
    f = np.arange(n) * rate / n
    spectrum = np.abs(np.fft.fft(speed, n))
    spectrum = spectrum / spectrum.max()
    keep = f <= cut
    f, spectrum = f[keep], spectrum[keep]
    above = np.flatnonzero(spectrum >= amplitude)
    f, spectrum = f[above[0]:above[-1] + 1], spectrum[above[0]:above[-1] + 1]
    return -float(np.sum(np.sqrt((np.diff(f) / (f[-1] - f[0])) ** 2 + np.diff(spectrum) ** 2)))


class Watched(VirtualTrial):
    """A trial whose palm is recorded while the arm reaches."""

    def __init__(self, **kw):
        super().__init__(**kw)
        self.palm = []
        cycle = self.rig.arm.cycle

        def recorded(now_ns):
            cycle(now_ns)
            arm = self.rig.arm
            if arm.active == "dmp" and arm.motion is not None:
                self.palm.append((self.rig.t, arm.chain.fk(arm.sample["position"])[0]))

        self.rig.arm.cycle = recorded


def campaign(actions, where, first_seed, **kw):
    """Run TRIALS trials; (results by action, trials)."""
    results, trials = {a: [] for a in actions}, []
    for seed in range(TRIALS):
        trial = Watched(seed=first_seed + seed, object_on=where, **kw)
        for result in trial.run(*actions):
            results[result.kind].append(result)
        trials.append(trial)
    return results, trials


def reach_figures(results, trials):
    """Lists over the trials: arrival later than a person's s, duration s, SPARC, palm error mm, angle deg."""
    late, ends, smooth, error, angle = [], [], [], [], []
    for result, trial in zip(results, trials, strict=False):
        if "motion_reached" not in result.marks:
            continue
        begin, end = result.marks["motion_started"], result.marks["motion_reached"]
        times = np.array([t for t, _ in trial.palm if begin <= t <= end])
        points = np.array([p for t, p in trial.palm if begin <= t <= end])
        if len(points) < 20:
            continue
        # The arm has arrived when it stays within 10 mm of where it ends; the state's own end comes a little later.
        far = np.flatnonzero(np.linalg.norm(points - points[-1], axis=1) > 0.010)
        arrived = float(times[far[-1]]) if len(far) else begin
        ends.append(end - begin)
        way = float(np.linalg.norm(points[-1] - points[0]))
        human = HUMAN_BASE * (way / 0.45) ** 0.3
        late.append((arrived - begin) - human)
        smooth.append(sparc(np.linalg.norm(np.diff(points, axis=0), axis=1) * 200.0, 200.0))
        if trial.palm_error is not None:
            error.append(trial.palm_error[0] * 1000)
            angle.append(np.degrees(trial.palm_error[1]))
    return late, ends, smooth, error, angle


def main() -> int:
    """Print the rows."""
    smach.set_loggers(*[lambda *a: None] * 4)
    rows = []
    started = time.process_time()
    virtual = 0.0
    for actions, where, seed in ((("exchange_human_to_robot", "exchange_robot_to_human"), "human_hand", 1000),
                                 (("take", "put"), "world", 1000)):
        results, trials = campaign(actions, where, seed)
        virtual += sum(t.rig.t for t in trials)
        for action in actions:
            share = sum(r.outcome == "succeeded" for r in results[action]) / max(1, TRIALS)
            rows.append(row(f"{action} succeeds", share, "share", ">= 0.97", share >= 0.97))
            for r in results[action]:
                if r.outcome != "succeeded":
                    print(f"{action}: {r.reason}", file=sys.stderr)
        violations = sum(t.rig.limit_violations for t in trials)
        rows.append(row(f"ticks outside joint limits, {' and '.join(actions)}", violations, "ticks", "<= 0",
                        violations == 0))
        moving = sum(t.rig.watched_while_moving for t in trials)
        rows.append(row(f"armed while moving, {' and '.join(actions)}", moving, "ticks", "<= 0", moving == 0))
    speed = virtual / (time.process_time() - started)
    rows.append(row("virtual over processor time", speed, "x", ">= 10", speed >= 10))
    for name, kw in (("perfect perception", {"perfect": True}), ("noisy perception", {})):
        results, trials = campaign(("exchange_human_to_robot",), "human_hand", 2000, **kw)
        late, ends, smooth, error, angle = reach_figures(results["exchange_human_to_robot"], trials)
        perfect = bool(kw)
        rows.append(row(f"palm to goal as received at the end, p95, {name}", np.percentile(error, 95), "mm",
                        "<= 5", np.percentile(error, 95) <= 5))
        rows.append(row(f"palm angle to the newest goal, p95, {name}", np.percentile(angle, 95), "deg",
                        "<= 3" if perfect else "", not perfect or np.percentile(angle, 95) <= 3))
        rows.append(row(f"arm there later than a person would be, median, {name}", np.median(late), "s",
                        "<= 0.25" if perfect else "", not perfect or np.median(late) <= 0.25))
        rows.append(row(f"duration of the reach until 'reached', median, {name}", np.median(ends), "s"))
        rows.append(row(f"SPARC of the reach, median, {name}", np.median(smooth), "1",
                        ">= -1.6" if perfect else "", not perfect or np.median(smooth) >= -1.6))
    print(json.dumps(rows))
    return 0 if all(r["ok"] for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
