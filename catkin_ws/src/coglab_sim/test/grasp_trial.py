"""One grasp in the plant: the arm shakes an object in the hand, then the hand releases it. For tests and benchmarks."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from coglab_objects.database import cell_parameters, objects_folder, read_object
from coglab_sim import _cell

SOURCES = Path(__file__).resolve().parents[2]
URDF = str(SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf")
HOME = np.array([-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782])
DIRECTIONS = {
    "palm up": [-1, 0, 0],
    "palm down": [1, 0, 0],
    "index up": [0, -1, 0],
    "index down": [0, 1, 0],
    "fingers down": [0, 0, 1],
}
"""Gravity in ih2_palm, in units of g."""
CYLINDRICAL = np.array([245, 5, 30, 50, 50]) / 255
STEP = 1e-3
G = 9.81
BOX = {"id": "box", "mass": 0.5, "shape": "box", "size": [0.08, 0.08, 0.04], "center": [0, 0, 0.02], "friction": 0.5}
BOARD_TOP = np.array([0.45, -0.55, 0.05])


def run(plant, seconds, dt=STEP, torque=None):
    """Runs for a time (s) with constant motor torques; returns the state."""
    for _ in range(round(seconds / dt)):
        plant.step(np.zeros(7) if torque is None else torque, dt)
    return plant.state()


def rotated(rotation, vector):
    """A vector turned by a quaternion x y z w."""
    x, y, z, w = rotation
    axis = np.array([x, y, z])
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


def product(one, two):
    """Of two quaternions x y z w."""
    a, b = np.asarray(one), np.asarray(two)
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])


def objects():
    """Objects of the database by name, as the plant takes them."""
    things = {}
    for path in sorted(objects_folder().glob("*.yaml")):
        entry, _ = read_object(path)
        things[path.stem] = {"id": path.stem, **cell_parameters(entry)}
    return things


@dataclass
class Outcome:
    """slip: m, displacement of the object in the hand during the shaking; released: s after the command to open; lost:
    the object left the hand during the shaking; forces: N, on phalanges and palm before it."""

    slip: float
    released: float
    lost: bool
    turned: float
    forces: dict


class GraspTrial:
    """The hand around an object whose axis lies across the palm."""

    def __init__(
        self,
        thing,
        direction="index up",
        current=240.0,
        shift=(0.0, 0.0),
        seed=1,
        depth=None,
        preshape=CYLINDRICAL,
        grasped=True,
    ):
        """``grasped``: the fingers close around the object; else they are open as preshaped, and it is elsewhere."""
        self.plant = plant = _cell.Plant(URDF, HOME, thing, seed=seed, board=False)
        self.centre = np.array(thing["center"], dtype=float)
        self.current = current
        palm_rotation = plant.state()["palm"][1]
        plant.set_gravity(9.81 * rotated(palm_rotation, np.array(DIRECTIONS[direction], dtype=float)))
        for motor, position in enumerate(preshape):
            plant.set_motor(motor, position)
        plant.hold(HOME, steps=300)
        # Object z along the index's side (palm y), object y out of the palm.
        turn = np.array([-0.5, -0.5, -0.5, 0.5])
        half = depth if depth is not None else thing["size"][0 if thing["shape"] != "box" else 1] / 2
        self.place, self.turn = np.array([half, shift[0], shift[1]]) - rotated(turn, self.centre), turn
        if grasped:
            plant.place("robot_hand", self.place, turn)

    def before_palm(self):
        """Pose of the object in the world where it would be grasped."""
        position, rotation = self.plant.state()["palm"]
        return position + rotated(rotation, self.place), product(rotation, self.turn)

    def in_palm(self):
        """Middle of the object and its axis in ih2_palm."""
        state = self.plant.state()
        position, rotation = state["palm"]
        back = rotation * [-1, -1, -1, 1]
        where, turn = state["object"]
        middle = where + rotated(turn, self.centre)
        return rotated(back, middle - position), rotated(back, rotated(turn, np.array([0.0, 0.0, 1.0])))

    def close(self, motors=(1, 2, 3, 4), seconds=1.6):
        """Close on the object, which the fingers hold already, and wait."""
        for motor in motors:
            self.plant.command_motor(motor, 1.0, 1.0, self.current)
        self.plant.hold(HOME, steps=int(seconds / STEP) + 300)

    def shake(self, acceleration=5.0, frequency=3.0, seconds=1.0):
        """Shake along the three axes of the world one after another; (slip m, turn rad, lost)."""
        begin, axis = self.in_palm()
        slip, turn, target = 0.0, 0.0, HOME.copy()
        omega = 2.0 * np.pi * frequency
        for direction in np.eye(3):
            for step in range(int(seconds / STEP)):
                speed = acceleration / omega * np.sin(omega * STEP * step) * direction
                jacobian = self.plant.terms()["jacobian"][:, :7]
                rate = jacobian.T @ np.linalg.solve(
                    jacobian @ jacobian.T + 1e-6 * np.eye(6), np.append(speed, np.zeros(3))
                )
                self.plant.hold(target, rate, 1)
                target = target + STEP * rate
                if step % 20 == 0:
                    now, axis_now = self.in_palm()
                    slip = max(slip, float(np.linalg.norm(now - begin)))
                    turn = max(turn, float(np.arccos(np.clip(axis @ axis_now, -1, 1))))
        return slip, turn, self.plant.state()["held_by"] != "robot"

    def open(self, limit=1.0):
        """Open; returns the time (s) until the object is free, infinite if it stays."""
        for motor in range(1, 5):
            self.plant.command_motor(motor, 0.0)
        for step in range(int(limit / 0.01)):
            if self.plant.state()["held_by"] != "robot":
                return 0.01 * step
            self.plant.hold(HOME, steps=10)
        return np.inf

    def run(self):
        """The whole trial."""
        self.close()
        forces = {name: float(np.linalg.norm(force)) for name, force in self.plant.touch().items()}
        slip, turn, lost = self.shake()
        return Outcome(slip, self.open(), lost, turn, forces)
