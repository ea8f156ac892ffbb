#!/usr/bin/python3
"""Rewrites the golden files from demonstrations.xml: the library as weights, and the motion of each primitive.

Computed only from the equations, in numpy: it imports none of the tested code. Eq. (1) and (2) of D4.10 are, in
units of the duration and with D = 2 sqrt(K), a critically damped spring under a force that depends on the phase alone,

    x'' + 2 k x' + k^2 x = f(s),   k = sqrt(K),   f(s) = (1 - w(s)) K (M phi(s) + x0) + w(s) K g,   s = exp(-alpha t)

whose solution is a convolution, here done by Gauss-Legendre quadrature:

    x(t) = exp(-k t) ((1 + k t) x0 + t v0) + integral_0^t (t - u) exp(-k (t - u)) f(u) du

Run it only after an intended change of format or law. The tests of both languages read its output.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
PANEL = 0.004
"""of the quadrature, in durations"""
GOAL_OFFSET = np.array([0.05, -0.1, 0.02])
"""m, from the goal of the demonstration to that of the golden motion"""
RATIO = 1.3
PERIOD = 0.005
"""s, of one step of the golden motion"""
STEPS = range(20, 401, 20)
# The choices of the least squares (coglab_controllers/dmp/learning.hpp): a path that ends at rest is held at its goal
# for a while; an end rests where it is slower than a share of the mean speed over a share of the samples.
HOLD, HOLD_WEIGHT, HOLDS = 0.3, 0.3, 60
REST_SPEED, REST_WINDOW = 0.1, 0.05


@dataclass
class Primitive:
    """The entry of one primitive in the library; lengths in m, times in s."""

    id: str
    description: str
    alpha: float
    stiffness: float
    regularisation: float
    count: int
    sigmoid: tuple[float, float] | None  # centre, steepness; None: w = 1 - s
    mapping: str
    paths: list[tuple[np.ndarray, np.ndarray]]  # times from the start, positions
    weights: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def centres(self) -> np.ndarray:
        """Equally spaced in time over the duration."""
        return np.exp(-self.alpha * np.arange(self.count) / (self.count - 1))

    @property
    def widths(self) -> np.ndarray:
        """One over the square of the distance to the next centre; the last as the one before."""
        gaps = -np.diff(self.centres)
        return 1.0 / np.append(gaps, gaps[-1]) ** 2

    @property
    def duration(self) -> float:
        """The mean of the demonstrations."""
        return float(np.mean([times[-1] for times, _ in self.paths]))

    @property
    def start(self) -> np.ndarray:
        """The mean of the demonstrations."""
        return np.mean([positions[0] for _, positions in self.paths], axis=0)

    @property
    def goal(self) -> np.ndarray:
        """The mean of the demonstrations."""
        return np.mean([positions[-1] for _, positions in self.paths], axis=0)

    def goal_weight(self, phase: np.ndarray) -> np.ndarray:
        """w(s) of eq. (1): 0 at the start, 1 at the end."""
        if self.sigmoid is None:
            return 1.0 - phase
        centre, steepness = self.sigmoid
        at = [1.0 / (1.0 + np.exp(steepness * (s - centre))) for s in (phase, 1.0, 0.0)]
        return (at[0] - at[1]) / (at[2] - at[1])

    def shares(self, phase: np.ndarray) -> np.ndarray:
        """psi_i(s) / sum of psi, one row per phase, eq. (5)."""
        psi = np.exp(-self.widths * (phase[:, None] - self.centres) ** 2)
        return psi / psi.sum(axis=1, keepdims=True)


def read(path: Path) -> list[Primitive]:
    """The demonstrations, by name."""
    numbers = lambda text: np.array([float(word) for word in text.split()])  # noqa: E731
    primitives = []
    for entry in ElementTree.parse(path).getroot().findall("primitive"):
        learn, weight, shape = (getattr(entry.find(name), "attrib", {}) for name in ("learn", "goal_weight", "shape"))
        paths = []
        bent = (float(weight["centre"]), float(weight["steepness"])) if weight.get("kind") == "sigmoid" else None
        for trajectory in entry.findall("trajectory"):
            samples = trajectory.findall("sample")
            times = np.array([float(sample.get("t", "nan")) for sample in samples])
            paths.append((times - times[0], np.array([numbers(sample.get("position", "")) for sample in samples])))
        primitives.append(
            Primitive(
                id=entry.get("id", ""),
                description=entry.get("description", ""),
                alpha=float(learn.get("alpha", np.log(100.0))),
                stiffness=float(learn.get("stiffness", 150.0)),
                regularisation=float(learn.get("regularisation", 1e-6)),
                count=int(learn.get("basis", 20)),
                sigmoid=bent,
                mapping=shape.get("mapping", "none"),
                paths=paths,
            )
        )
    return sorted(primitives, key=lambda primitive: primitive.id)


def convolve(primitive: Primitive, force, times: np.ndarray) -> np.ndarray:
    """The forced part of x at the times (in durations) under `force(phase)`, which gives one row per phase."""
    k = np.sqrt(primitive.stiffness)
    nodes, shares = np.polynomial.legendre.leggauss(8)
    rows = []
    for time in times:
        edges = np.linspace(0.0, time, max(2, int(np.ceil(time / PANEL)) + 1))
        half = np.diff(edges)[:, None] / 2.0
        at = (edges[:-1, None] + half + half * nodes).ravel()
        kernel = (time - at) * np.exp(-k * (time - at)) * (half * shares).ravel()
        rows.append(kernel @ force(np.exp(-primitive.alpha * at)))
    return np.array(rows)


def free(primitive: Primitive, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contributions of x0 and of v0 at the times (in durations)."""
    k = np.sqrt(primitive.stiffness)
    return np.exp(-k * times) * (1.0 + k * times), np.exp(-k * times) * times


def learn(primitive: Primitive) -> None:
    """Weights and start velocity by least squares on the path, which is linear in both."""
    unknowns, columns, targets = primitive.count + len(primitive.paths), [], []
    for number, (times, positions) in enumerate(primitive.paths):
        duration, length = times[-1], np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()
        window = max(1, int(REST_WINDOW * len(times)))
        limit = REST_SPEED * length / duration
        rests_first = np.linalg.norm(positions[window] - positions[0]) / (times[window] - times[0]) < limit
        rests_last = np.linalg.norm(positions[-1] - positions[-1 - window]) / (times[-1] - times[-1 - window]) < limit
        at, wanted = times / duration, positions
        weight = np.full(len(times), 1.0 / (length * np.sqrt(len(times))))
        if rests_last:
            at = np.append(at, 1.0 + HOLD * np.arange(1, HOLDS + 1) / HOLDS)
            wanted = np.vstack([wanted, np.tile(positions[-1], (HOLDS, 1))])
            weight = np.append(weight, np.full(HOLDS, HOLD_WEIGHT / (length * np.sqrt(HOLDS))))

        def force(phase: np.ndarray) -> np.ndarray:
            w = primitive.goal_weight(phase)
            learnt = primitive.stiffness * (1.0 - w)[:, None] * primitive.shares(phase)
            return np.column_stack([learnt, primitive.stiffness * w, primitive.stiffness * (1.0 - w)])

        response = convolve(primitive, force, at)
        of_start, of_velocity = free(primitive, at)
        block = np.zeros((len(at), unknowns))
        block[:, : primitive.count] = response[:, : primitive.count]
        if not rests_first:
            block[:, primitive.count + number] = of_velocity * duration
        rest = wanted - np.outer(response[:, -2], positions[-1]) - np.outer(response[:, -1] + of_start, positions[0])
        columns.append(weight[:, None] * block)
        targets.append(weight[:, None] * rest)
    matrix, target = np.vstack(columns), np.vstack(targets)
    ridge = np.sqrt(primitive.regularisation * np.mean(np.sum(matrix[:, : primitive.count] ** 2, axis=0)))
    matrix = np.vstack([matrix, ridge * np.eye(unknowns)[: primitive.count]])
    target = np.vstack([target, np.zeros((primitive.count, 3))])
    solution = np.linalg.lstsq(matrix, target, rcond=None)[0]
    primitive.weights = solution[: primitive.count]
    primitive.velocity = solution[primitive.count :].mean(axis=0)


def shape_map(mapping: str, demonstrated: np.ndarray, line: np.ndarray) -> np.ndarray:
    """The 3x3 map of a shape from the demonstration's line to the present one."""
    if mapping == "none":
        return np.eye(3)
    scale = np.linalg.norm(line) / np.linalg.norm(demonstrated)
    if mapping == "similarity":
        # The smallest rotation from one line to the other (Rodrigues), and the ratio of their lengths.
        a, b = demonstrated / np.linalg.norm(demonstrated), line / np.linalg.norm(line)
        x, y, z = np.cross(a, b)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return scale * (np.eye(3) + cross + cross @ cross / (1.0 + a @ b))
    # Upright: a turn about the vertical that brings the level parts together, scaled by their lengths; heights scaled
    # by the lengths of the lines, and tilted along the way by what is then missing at the end.
    flat, flat_line = np.hypot(*demonstrated[:2]), np.hypot(*line[:2])
    turn = np.arctan2(line[1], line[0]) - np.arctan2(demonstrated[1], demonstrated[0])
    result = np.zeros((3, 3))
    result[:2, :2] = flat_line / flat * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    result[2, 2] = scale
    result[2, :2] = (line[2] - scale * demonstrated[2]) * demonstrated[:2] / flat**2
    return result


def motion(primitive: Primitive, goal: np.ndarray, ratio: float, times: np.ndarray) -> np.ndarray:
    """Positions at the times (s) of a motion from the primitive's start, at rest, to a fixed goal."""
    at = times / (ratio * primitive.duration)
    shape = shape_map(primitive.mapping, primitive.goal - primitive.start, goal - primitive.start)

    def force(phase: np.ndarray) -> np.ndarray:
        w = primitive.goal_weight(phase)[:, None]
        moving_point = primitive.shares(phase) @ primitive.weights @ shape.T + primitive.start
        return primitive.stiffness * ((1.0 - w) * moving_point + w * goal)

    return convolve(primitive, force, at) + np.outer(free(primitive, at)[0], primitive.start)


def words(values) -> str:
    """Numbers as text with 12 digits, more than two methods of computation agree on."""
    return " ".join(f"{float(value) if abs(value) > 1e-12 else 0.0:.12g}" for value in np.atleast_1d(values))


def library(primitives: list[Primitive]) -> str:
    """The text of weights.xml."""
    lines = ['<?xml version="1.0"?>', '<dmp_library version="1">']
    for p in primitives:
        described = f' description="{p.description}"' if p.description else ""
        weight = "linear" if p.sigmoid is None else "sigmoid"
        of_sigmoid = "" if p.sigmoid is None else f' centre="{words(p.sigmoid[0])}" steepness="{words(p.sigmoid[1])}"'
        damping = 2.0 * np.sqrt(p.stiffness)
        system = ("duration", p.duration), ("alpha", p.alpha), ("stiffness", p.stiffness), ("damping", damping)
        lines += [
            f'    <primitive id="{p.id}"{described}>',
            "        <system " + " ".join(f'{name}="{words(value)}"' for name, value in system) + "/>",
            f'        <goal_weight kind="{weight}"{of_sigmoid}/>',
            f'        <shape mapping="{p.mapping}"/>',
            f'        <start position="{words(p.start)}" velocity="{words(p.velocity)}"/>',
            f'        <goal position="{words(p.goal)}"/>',
        ]
        for centre, width, row in zip(p.centres, p.widths, p.weights, strict=True):
            lines.append(f'        <basis centre="{words(centre)}" width="{words(width)}" weight="{words(row)}"/>')
        lines.append("    </primitive>")
    return "\n".join([*lines, "</dmp_library>", "", ""])


def motions(primitives: list[Primitive]) -> str:
    """The text of motions.csv."""
    rows = ["primitive,step,x,y,z"]
    for primitive in primitives:
        path = motion(primitive, primitive.goal + GOAL_OFFSET, RATIO, PERIOD * np.array(STEPS))
        places = [words(place).replace(" ", ",") for place in path]
        rows += [f"{primitive.id},{step},{place}" for step, place in zip(STEPS, places, strict=True)]
    return "\n".join(rows) + "\n"


def derive() -> list[Primitive]:
    """All primitives, learnt."""
    primitives = read(HERE / "demonstrations.xml")
    for primitive in primitives:
        learn(primitive)
    return primitives


def main() -> None:
    """Writes weights.xml and motions.csv."""
    primitives = derive()
    (HERE / "weights.xml").write_text(library(primitives))
    (HERE / "motions.csv").write_text(motions(primitives))


if __name__ == "__main__":
    main()
