#!/usr/bin/python3
"""A handover with the attitude from an IMU in the palm, compared with the same handover without it. The joint sensors
of the simulated arm are exact, so the IMU can only add its error. On a flexible arm it can help."""

import coglab
import numpy as np
from example import new_figure, parser, save

arguments = parser(__doc__)
arguments.add_argument("--seed", type=int, default=3)
options = arguments.parse_args()


def turn_between(one: np.ndarray, other: np.ndarray) -> float:
    """Angle (degrees) between two orientations, quaternions x y z w."""
    return float(np.degrees(2.0 * np.arccos(min(1.0, abs(float(np.dot(one, other)))))))


def handover(feedback: str) -> tuple[coglab.Trial, np.ndarray]:
    """A handover to the robot. Rows, while a primitive moves: time s; in degrees the orientation error, the correction
    and the IMU's own error."""
    rows: list[tuple[float, ...]] = []

    def look(world: coglab.World) -> None:
        robot = world.cell.robot.virtual
        record, report = world.cell.robot.debug, world.cell.robot.report
        if record is None or report["active"] != "dmp" or report["motion"] != "running":
            return
        changes = [change for change in robot.feedback.last_cycle().changes if change.controller == "attitude"]
        corrected = np.degrees(changes[0].angle) if changes else 0.0
        palm = world.truth["robot_hand"]["rotation"]
        measured = world.cell.cell.palm_sensors()["orientation"]
        rows.append((world.time, turn_between(record["set_point"][1], palm), corrected, turn_between(measured, palm)))

    with coglab.World(seed=options.seed, feedback=feedback) as world:
        world.after_period.append(look)
        trial = world.trial("receive")
    return trial, np.array(rows)


figure = new_figure(8, 6)
top, bottom = figure.subplots(2, sharex=True)
for name, label, colour in (("", "without", "0.5"), ("palm", "Attitude by the IMU", "C0")):
    trial, rows = handover(name)
    print(f"{label}: {trial.results[0]}; orientation error rms {np.sqrt(np.mean(rows[:, 1] ** 2)):.2f} degrees")
    time = rows[:, 0] - trial.results[0].started
    time[1:][np.diff(time) > 0.05] = np.nan  # between two motions
    top.plot(time, rows[:, 1], color=colour, label=label)
    if name:
        top.plot(time, rows[:, 3], ":", color="C1", linewidth=0.8, label="error of the IMU itself")
        bottom.plot(time, rows[:, 2], color=colour)
top.set_ylabel("orientation error [deg]")
top.legend()
bottom.set_ylabel("correction [deg]")
bottom.set_xlabel("time since the start [s], while a primitive moves")
save(figure, __file__, options.out)
