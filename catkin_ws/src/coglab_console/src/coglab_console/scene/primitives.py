"""Primitives of a library file, for plots.

Reads the XML of dmp/load_dmps and integrates eq. (1)-(5) of D4.10 numerically for a goal at rest. The result is a
picture, not the executed motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

MAX_FILE = 4_000_000  # bytes
STEPS = 200
BEYOND = 1.6  # durations, longest integration
NEAR = 0.004  # m from the goal at which a path is over
SHORTEST = 1e-3  # m, a shorter line has no direction


class LibraryError(Exception):
    """The file cannot be shown. The message names it and the reason."""


@dataclass(frozen=True)
class Primitive:
    """Parameters of eq. (1)-(5). weights: (n, 3) in m, relative to the start."""

    name: str
    description: str
    duration: float
    alpha: float
    stiffness: float
    damping: float
    weight: tuple[str, float, float]  # kind, centre, steepness
    mapping: str
    start: np.ndarray
    goal: np.ndarray
    centres: np.ndarray
    widths: np.ndarray
    weights: np.ndarray

    def share_of_goal(self, s: float) -> float:
        """w(s) of eq. (1)."""
        kind, centre, steepness = self.weight
        if kind != "sigmoid":
            return 1.0 - s
        begin, end = _logistic(steepness * (1.0 - centre)), _logistic(-steepness * centre)
        return (_logistic(steepness * (s - centre)) - begin) / (end - begin)

    def moving_point(self, s: float) -> np.ndarray:
        """phi(s) of eq. (5), m, as demonstrated."""
        exponent = -self.widths * (s - self.centres) ** 2
        psi = np.exp(exponent - exponent.max())
        return psi @ self.weights / psi.sum()

    def roll_out(self, start: np.ndarray, goal: np.ndarray, ratio: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) in s and positions (n, 3) in m from `start` at rest to `goal`; `ratio` is dmp_ratio."""
        turn = shape_map(self.mapping, self.goal - self.start, goal - start)
        tau = self.duration * ratio
        dt = BEYOND * tau / STEPS
        x, v = start.astype(float), np.zeros(3)
        times, points = [0.0], [x.copy()]
        inner = 4
        for step in range(STEPS):
            for part in range(inner):
                s = math.exp(-self.alpha * (step + part / inner) * dt / tau)
                w = self.share_of_goal(s)
                pull = (1 - w) * (turn @ self.moving_point(s) + start - x) + w * (goal - x)
                v = v + dt / inner / tau * (self.stiffness * pull - self.damping * v)
                x = x + dt / inner / tau * v
            times.append((step + 1) * dt)
            points.append(x.copy())
            if times[-1] >= tau and np.linalg.norm(goal - x) < NEAR:
                break
        return np.array(times), np.array(points)


def _logistic(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x))


def shape_map(mapping: str, demonstrated: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) that maps the learnt shape to another line from start to goal."""
    before, after = np.linalg.norm(demonstrated), np.linalg.norm(line)
    if mapping == "none" or before < SHORTEST:
        return np.eye(3)
    if after < 1e-9:
        return np.zeros((3, 3))
    scale = after / before
    flat_before, flat_after = np.hypot(*demonstrated[:2]), np.hypot(*line[:2])
    if mapping == "similarity" or min(flat_before, flat_after) < SHORTEST:
        return scale * _turn_between(demonstrated / before, line / after)
    up = np.array([0.0, 0.0, 1.0])
    ahead, ahead_now = np.array([*demonstrated[:2], 0.0]) / flat_before, np.array([*line[:2], 0.0]) / flat_after
    level = np.outer(ahead_now, ahead) + np.outer(np.cross(up, ahead_now), np.cross(up, ahead))
    tilt = (line[2] - scale * demonstrated[2]) / flat_before * np.outer(up, ahead)
    return flat_after / flat_before * level + scale * np.outer(up, up) + tilt


def _turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest rotation that takes the unit vector a to b."""
    axis, cosine = np.cross(a, b), float(a @ b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        if cosine > 0.0:
            return np.eye(3)
        axis = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 1.0, 0.0])  # any axis at a right angle to a
    angle = float(np.arctan2(sine, cosine))
    turn: np.ndarray = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return turn


def _triple(text: str) -> np.ndarray:
    values = np.array([float(word) for word in text.split()])
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise ValueError(f"expected three numbers, got '{text[:60]}'")
    return values


def _place(element: ElementTree.Element, tag: str) -> str:
    found = element.find(tag)
    if found is None:
        raise ValueError(f"<{tag}> is missing")
    return found.attrib["position"]


def _primitive(element: ElementTree.Element) -> Primitive:
    system, weight, shape = element.find("system"), element.find("goal_weight"), element.find("shape")
    basis = element.findall("basis")
    if system is None or not basis:
        raise ValueError("<system> or <basis> is missing")
    kind = ("linear", 0.5, 10.0)
    if weight is not None:
        kind = (weight.get("kind", "linear"), float(weight.get("centre", "0.5")), float(weight.get("steepness", "10")))
    return Primitive(
        element.attrib["id"],
        element.get("description", ""),
        float(system.attrib["duration"]),
        float(system.attrib["alpha"]),
        float(system.attrib["stiffness"]),
        float(system.attrib["damping"]),
        kind,
        shape.get("mapping", "none") if shape is not None else "none",
        _triple(_place(element, "start")),
        _triple(_place(element, "goal")),
        np.array([float(one.attrib["centre"]) for one in basis]),
        np.array([float(one.attrib["width"]) for one in basis]),
        np.array([_triple(one.attrib["weight"]) for one in basis]),
    )


def load_library(path: Path) -> dict[str, Primitive]:
    """Returns the primitives of a file by name. The message of a LibraryError names file and primitive."""
    try:
        if path.stat().st_size > MAX_FILE:
            raise LibraryError(f"{path} has more than {MAX_FILE} bytes")
        root = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        raise LibraryError(f"{path} cannot be read: {error}") from error
    found = {}
    for element in root.findall("primitive"):
        try:
            found[element.attrib["id"]] = _primitive(element)
        except (KeyError, ValueError, AttributeError) as error:
            raise LibraryError(f"{path}: primitive '{element.get('id', '?')}': {error}") from error
    return found


def document(library: dict[str, Primitive]) -> list[dict]:
    """Document for the page: each primitive as demonstrated, with time (s), position x, y, z (m) and speed (m/s)."""
    rows = []
    for one in library.values():
        times, points = one.roll_out(one.start, one.goal)
        speed = np.linalg.norm(np.gradient(points, times, axis=0), axis=1)
        rows.append(
            {
                "name": one.name,
                "description": one.description,
                "duration": one.duration,
                "mapping": one.mapping,
                "basis": len(one.centres),
                "end_error_mm": round(float(np.linalg.norm(points[-1] - one.goal)) * 1000, 2),
                "plot": [
                    [round(float(t), 3), *(round(float(p), 4) for p in point), round(float(v), 4)]
                    for t, point, v in zip(times[::4], points[::4], speed[::4], strict=True)
                ],
            }
        )
    return rows
