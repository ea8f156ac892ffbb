"""Contact from the torques of an arm that moves: momentum observer, its change, thresholds, and how to learn them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
from coglab_py.pose import length

from coglab_contact.detector import REMEMBERED
from coglab_contact.evidence import MOMENTUM, Evidence
from coglab_contact.momentum_observer import Dynamics, Joints, MomentumObserver, Residual
from coglab_contact.motion_thresholds import CONFIRM, Change, ChangeOfResidual, Offset, Thresholds, learn

HOLD = 0.03  # s for which one sample counts
STILL = 0.02  # rad/s; a joint faster than this is motion
SLOW = 0.15  # rad/s of the fastest joint
GENTLE = 1.0  # rad/s^2
SETTLED = 0.25  # s of stillness before the residual is taken as that of a free arm
LEAD = 0.03  # s by which a force is extrapolated: about the observer's own delay
GROWTH = 0.02  # s over which its growth is measured


SHORTEST = 40  # samples of a motion that counts
LONGEST = 4000  # samples of one that is kept; what follows belongs to the next


class MovingContact:
    """Feed it every sample of lwr/joint_states, and ask it for evidence. The hand carries nothing until it is told."""

    def __init__(
        self,
        thresholds: Thresholds,
        dynamics: Dynamics,
        jacobian: Callable[[Joints], np.ndarray],
        period: float = 0.0,
    ) -> None:
        """``jacobian``: position of the joints (rad) to the palm's 3 x 7, base frame. ``period``: see
        MomentumObserver."""
        self.observer = MomentumObserver(dynamics, period=period)
        self.use(thresholds)
        self.load = 0.0
        self.change: Change | None = None
        """the newest one"""
        self.residual: Residual | None = None
        """the newest one"""
        self._jacobian = jacobian
        self._changes = ChangeOfResidual(jacobian)
        self._newest: deque[Change] = deque(maxlen=CONFIRM)
        self._still_since: float | None = None
        self._rest: np.ndarray | None = None
        self._free: np.ndarray | None = None
        """mean residual of the rest before the motion, or of this one while the arm has not moved"""
        self._rest_position, self._rest_stamp = np.zeros(7), 0.0
        self._free_weight: float | None = None  # N on the palm then
        self._growing: deque[tuple[float, np.ndarray]] = deque()  # s and Nm: the residuals of the last GROWTH

    def use(self, thresholds: Thresholds) -> None:
        """These thresholds, and the lag of the torques that was learnt with them, from now on."""
        self.thresholds = thresholds
        self.observer.lag = thresholds.lag

    def set_payload(self, mass: float, centre: Joints = (0.0, 0.0, 0.0)) -> None:
        """The hand carries ``mass`` kg at ``centre`` (m, ih2_palm) from now on; the past does not count any more, so
        that the load's own coming is no contact. ValueError for what is no mass."""
        self.observer.set_payload(mass, centre)
        self.load = mass
        self._forget()

    def _forget(self) -> None:
        self._changes.reset()
        self._newest.clear()
        self._growing.clear()
        self.change = self._still_since = self._rest = self._free = self._free_weight = None

    def still(self) -> bool:
        """Whether the arm has stood still long enough."""
        return self._rest is not None

    def offset(self) -> Offset | None:
        """Residual of a moment ago less that of the last rest before the motion; None where no rest was seen."""
        if self.change is None or self._free is None:
            return None
        return Offset(self._changes.past - self._free, self.change.jacobian)

    def offset_of_motion(self) -> Offset | None:
        """Residual of this rest less that of the rest before the motion; None while the arm moves."""
        if self.change is None or self._free is None or self._rest is None:
            return None
        return Offset(self._rest - self._free, self.change.jacobian)

    def steady(self) -> Evidence | None:
        """What the offset says: a person who was early has left one before anybody watched."""
        offset = self.offset()
        if offset is None or self.change is None or self.load > 0.0:
            return None
        force, size = self.thresholds.steady_force(offset, self.change.features)
        stamp, margin = self.change.stamp, size / self.thresholds.steady_limit
        message = f"{length(force):.1f} N on the hand since the arm stood still: it was there already"
        return Evidence(MOMENTUM, stamp, stamp + HOLD, margin, message)

    def weight_since(self, before: np.ndarray) -> float:
        """N that have come to hang on the palm since the residual was ``before`` (Nm), whether the arm moves or not:
        down's part of the force on the palm that explains the change best, so that a pull aside is no weight."""
        assert self.residual is not None
        return self.weight(self.residual.torque - before, self.residual.position)

    def weight(self, residual: Joints, position: Joints) -> float:
        """N that hang on the palm by a residual (Nm) at a position (rad): see weight_since."""
        return -float(np.linalg.lstsq(self._jacobian(position).T, residual, rcond=0.05)[0][2])

    def before_motion(self) -> np.ndarray | None:
        """Mean residual (Nm) of the last rest before the motion that goes on or was the last, or of this rest while the
        arm has not moved; None where none was seen."""
        return self._rest if self._free is None else self._free

    def force_since(self, before: np.ndarray) -> np.ndarray | None:
        """N on the palm, base frame, beyond what acted when the residual was ``before`` (Nm): as far as it will have
        grown in LEAD s if it goes on like that. None where nothing was measured yet."""
        if not self._growing or self.residual is None:
            return None
        (begin, first), (stamp, torque) = self._growing[0], self._growing[-1]
        growth = (torque - first) / (stamp - begin) if stamp > begin else np.zeros(7)
        ahead = torque + LEAD * growth - before
        return np.asarray(np.linalg.lstsq(self._jacobian(self.residual.position).T, ahead, rcond=0.05)[0])

    def weight_before_motion(self) -> float | None:
        """N on the palm in the last rest before the motion that goes on or was the last; None where none was seen."""
        return self._free_weight

    def slow(self) -> bool:
        """Whether the arm moves so little that what is missing in its model's inertia is no force."""
        residual = self.residual
        if residual is None or np.abs(residual.velocity).max() > SLOW:
            return False
        return bool(np.abs(residual.acceleration).max() < GENTLE)

    def _follow_rest(self, residual: Residual) -> None:
        if np.abs(residual.velocity).max() > STILL:
            if self._rest is not None:
                self._free = self._rest
                self._free_weight = self.weight(self._rest, self._rest_position)
            self._still_since = self._rest = None
        elif self._still_since is None:
            self._still_since = residual.stamp
        elif residual.stamp - self._still_since >= SETTLED:
            rest = residual.torque if self._rest is None else self._rest
            share = min(1.0, (residual.stamp - self._rest_stamp) / REMEMBERED)
            self._rest = rest + share * (residual.torque - rest)
            self._rest_position, self._rest_stamp = residual.position, residual.stamp

    def feed(self, stamp: float, position: Joints, torque: Joints, made: float | None = None) -> None:
        """One sample: s, rad, Nm as measured; ``made``: see MomentumObserver.feed."""
        residual = self.residual = self.observer.feed(stamp, position, torque, made)
        if residual is None:
            return
        if residual.fresh:
            self._forget()
        self._follow_rest(residual)
        now = residual.stamp if made is None else made
        if self._growing and now < self._growing[-1][0]:
            self._growing.clear()
        self._growing.append((now, residual.torque))
        while self._growing[0][0] < now - GROWTH - 1e-9:
            self._growing.popleft()
        self.change = self._changes.feed(residual, self.load)
        if self.change is not None:
            self._newest.append(self.change)

    def evidence(self) -> Evidence | None:
        """What the newest samples say; None while there is too little of a past, or where the last sample was left
        out. Who does not watch does not ask: the force behind a change costs more than all the rest."""
        if self.residual is None or self.change is None:
            return None
        forces = [self.thresholds.force(change) for change in self._newest]
        force, size = forces[-1]
        sure = min(each for _, each in forces) if len(forces) == CONFIRM else 0.0
        message = f"{length(force):.1f} N on the hand, {size:.0f} deviations of the moving arm's"
        stamp = self.change.stamp
        return Evidence(MOMENTUM, stamp, stamp + HOLD, sure / self.thresholds.limit, message)


def unwritable(file: str) -> str:
    """Why what is learnt cannot be written to this file, in a sentence; empty where it can. The file is not touched: an
    empty one would be read at the next start."""
    path = Path(file)
    if path.is_dir():
        return f"{path} is a folder: name a file in it"
    if path.exists():
        return "" if os.access(path, os.W_OK) else f"{path} may not be written"
    folder = path.absolute().parent
    if not folder.is_dir():
        return f"{path} cannot be written, for the folder {folder} is not there: create it"
    return "" if os.access(folder, os.W_OK) else f"{path} cannot be written, for the folder {folder} may not be written"


class MotionRecorder:
    """Look at a MovingContact after each sample; nobody touches the arm meanwhile."""

    def __init__(self, moving: MovingContact) -> None:
        self.moving = moving
        self.reaches: list[list[Change]] = []
        self.offsets: list[Offset] = []
        self._reach: list[Change] = []
        self._stamp = 0.0

    def look(self) -> None:
        """After each sample of the arm: one motion lasts from rest to rest."""
        change = self.moving.change
        if change is None or change.stamp == self._stamp:
            return
        self._stamp = change.stamp
        self._reach.append(change)
        resting = self.moving.still()
        if len(self._reach) >= LONGEST or (resting and self._moved()):
            self.end()
        elif resting:
            # Of the rest before a motion its last moment belongs to it: the stop of the one before does not.
            self._reach = self._reach[-SHORTEST:]

    def _moved(self) -> bool:
        return max(change.features[0, 1] for change in self._reach) > 0.1

    def end(self) -> None:
        """The motion is over, or has lasted long enough."""
        if len(self._reach) >= SHORTEST and self._moved():
            self.reaches.append(self._reach)
            offset = self.moving.offset_of_motion()
            if offset is not None and self.moving.load == 0.0:
                self.offsets.append(offset)
        self._reach = []

    def learn(self) -> Thresholds:
        """From what was gathered. ThresholdError where that is too little."""
        return learn(self.reaches, self.offsets, lag=self.moving.thresholds.lag)
