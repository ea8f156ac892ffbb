#!/usr/bin/python3
"""A small study: the same people, two timings of the robot; fluency after Hoffman (2019)."""

import coglab
import numpy as np
from example import new_figure, parser, save


def main() -> None:
    """Workers import this file, so nothing may run without this function."""
    arguments = parser(__doc__)
    arguments.add_argument("--people", type=int, default=3, help="people for each timing")
    arguments.add_argument("--workers", type=int, default=2)
    options = arguments.parse_args()

    timings = ("calm", "natural")
    table = []
    for timing in timings:
        trials = coglab.trials(options.people, workers=options.workers, settings={"timing": timing})
        rows = [trial.fluency() for trial in trials if trial]
        values = [(r.human_idle, r.robot_idle, r.concurrent_activity, r.functional_delay) for r in rows]
        table.append(np.mean(np.reshape(values, (-1, 4)), axis=0))
        duration = np.mean([r.duration for r in rows])
        print(f"{timing}: {len(rows)} of {len(trials)} succeeded, {duration:.1f} s", np.round(table[-1], 2))

    figure = new_figure(8, 4)
    axes = figure.subplots()
    labels = ("person idle", "robot idle", "both active", "functional delay")
    for k, (timing, row) in enumerate(zip(timings, table, strict=True)):
        axes.bar(np.arange(4) + 0.27 * (k - 0.5), 100.0 * row, 0.25, label=timing)
    axes.set_xticks(range(4), labels)
    axes.set_ylabel("share of the handover [%]")
    axes.axhline(0.0, color="0.2", linewidth=0.8)
    axes.legend()
    save(figure, __file__, options.out)


if __name__ == "__main__":
    main()
