"""Policies to compare with: a straight-line reach, and random actions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from coglab_py.pose import Pose, length

from coglab.envs.handover import SPEED, TURNING
from coglab.envs.referee import RECEIVE
from coglab.envs.stage import CLOSED, OPEN

LIFT_SPEED = 0.03  # m/s

Observation = Mapping[str, Any]


class Policy(Protocol):
    """Chooses actions of control "palm_twist"."""

    def reset(self) -> None:
        """Another episode begins."""

    def act(self, observation: Observation) -> np.ndarray:
        """Returns the action (7,) for an observation."""


class RandomPolicy:
    """Actions that are drawn evenly from -1..1."""

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)

    def reset(self) -> None:
        """Nothing to forget."""

    def act(self, observation: Observation) -> np.ndarray:
        """Returns a random action, (7,)."""
        return self._rng.uniform(-1.0, 1.0, 7).astype(np.float32)


@dataclass
class Reaching:
    """Parameters of StraightReach."""

    speed: float = 0.45
    """m/s, largest speed"""
    gain: float = 3.0
    """1/s, speed per m to go"""
    stand_off: float = 0.025
    """m before the goal, along the palm's normal, at which the palm waits for the person (receiving)"""
    across: float = 0.0
    """m, offset of the palm along its y axis"""
    along: float = 0.0
    """m, offset of the palm along its z axis, to the fingertips"""
    within: float = 0.95
    """m from the robot's base: the palm waits until its target is nearer"""
    smoothing: float = 0.5
    """0..1, weight of the last target against a new sight"""
    still: float = 0.02
    """m to the target below which the palm stands still"""
    touch: float = 1.5
    """Nm, change of the external torques that counts as the person's hand"""
    patience: float = 2.5
    """s after which the hand acts without having felt the person"""
    lift: float = 0.0
    """m, way up once the hand holds the object (receiving): people let go when they feel that the robot carries it"""


class StraightReach:
    """Moves the palm straight to the place of the handover as last seen, stands still, and closes or opens the hand
    once it feels the person, or after a while."""

    def __init__(self, task: str, reaching: Reaching | None = None) -> None:
        self.task, self.reaching = task, reaching or Reaching()
        self.reset()

    def reset(self) -> None:
        """Another episode begins."""
        self._target: Pose | None = None
        self._stands: float | None = None
        self._calm: np.ndarray | None = None
        self._held: float | None = None
        self._acted = False

    def act(self, observation: Observation) -> np.ndarray:
        """Returns the action (7,) for an observation."""
        action = np.zeros(7, dtype=np.float32)
        rest = OPEN if self.task == RECEIVE else CLOSED
        if self._acted or int(observation["phase"]) != rest:
            self._acted = True  # stand still while the hand acts, and afterwards
            action[6] = 1.0 if self.task == RECEIVE else -1.0
            if self.task == RECEIVE and float(observation["holding"][0]) > 0.0:
                self._lift(observation, action)
            return action
        self._see(observation)
        if self._target is None:
            return action
        palm, p = _pose(observation["palm"]), self.reaching
        way = self._target.position - palm.position
        turn = (self._target.rotation * palm.rotation.inv()).as_rotvec()
        if self._stands is None and length(way) > p.still:
            velocity = min(p.speed, p.gain * length(way)) * way / length(way)
            action[:3] = velocity / SPEED
            action[3:6] = np.clip(p.gain * turn / TURNING, -1.0, 1.0)
        elif length(way) > 3.0 * p.still:
            self._stands = self._calm = None  # the person has gone on
        else:
            self._wait(observation)
        return action

    def _see(self, observation: Observation) -> None:
        """Takes a new sight of the object or the person's hand over into the target."""
        name = "object" if self.task == RECEIVE else "human_hand"
        if float(observation[name + "_age"][0]) > 0.3:
            return
        p, target = self.reaching, _pose(observation[name]) * _pose(observation["goal"])
        off = target.rotation.apply([-p.stand_off if self.task == RECEIVE else 0.0, p.across, p.along])
        target = Pose(target.position + off, target.orientation)
        if length(target.position[:2]) > p.within:
            return
        if self._target is not None:
            middle = p.smoothing * self._target.position + (1.0 - p.smoothing) * target.position
            target = Pose(middle, target.orientation)
        self._target = target

    def _lift(self, observation: Observation, action: np.ndarray) -> None:
        """Sets the part of the action that raises the object."""
        now = float(observation["time"][0])
        if self._held is None and int(observation["phase"]) == CLOSED:
            self._held = now
        if self._held is not None and now - self._held < self.reaching.lift / LIFT_SPEED:
            action[2] = LIFT_SPEED / SPEED

    def _wait(self, observation: Observation) -> None:
        """Stands still until the person is felt."""
        now, torque = float(observation["time"][0]), np.asarray(observation["external_torque"], dtype=float)
        if self._stands is None:
            self._stands = now
        waited = now - self._stands
        if waited < 0.3:
            return  # the arm's own braking
        if self._calm is None:
            self._calm = torque
        felt = length(torque - self._calm) > self.reaching.touch
        self._acted = felt or waited > self.reaching.patience


def _pose(numbers: Any) -> Pose:
    values = np.asarray(numbers, dtype=float)
    return Pose(values[:3], values[3:])
