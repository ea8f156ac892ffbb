#!/usr/bin/python3
"""Handovers with many drawn people, on several processors: success, durations, forces."""

import coglab
import numpy as np
from example import new_figure, parser, save


def main() -> None:
    """Workers import this file, so nothing may run without this function."""
    arguments = parser(__doc__)
    arguments.add_argument("--people", type=int, default=10, help="number of people (default 10; 100 take minutes)")
    arguments.add_argument("--workers", type=int, default=2)
    options = arguments.parse_args()

    trials = coglab.trials(options.people, "receive", workers=options.workers)
    good = [trial for trial in trials if trial]
    print(f"{len(good)} of {len(trials)} handovers succeeded")
    for trial in trials:
        if not trial:
            print(f"  seed {trial.seed}: {trial.results[-1]}")

    figure = new_figure(9, 3.5)
    left, middle, right = figure.subplots(1, 3)
    left.hist([trial.results[0].duration for trial in good], bins=12)
    left.set_xlabel("duration [s]")
    left.set_ylabel("handovers")
    middle.hist([trial.peak_force for trial in good], bins=12)
    middle.set_xlabel("largest force while both hold [N]")
    fluency = np.array([(f.human_idle, f.robot_idle, f.concurrent_activity) for f in (t.fluency() for t in good)])
    right.boxplot(100.0 * fluency.reshape(-1, 3))
    right.set_xticks([1, 2, 3], ["person idle", "robot idle", "both active"], fontsize=8)
    right.set_ylabel("share of the time [%]")
    save(figure, __file__, options.out)


if __name__ == "__main__":
    main()
