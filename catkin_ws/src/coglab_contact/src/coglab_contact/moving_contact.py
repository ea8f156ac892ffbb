"""Contact from the torques of a moving arm: momentum observer, change of its residual, learnt thresholds."""

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

HOLD = 0.03  # s, validity of one sample
STILL = 0.02  # rad/s; the arm moves if a joint is faster
SLOW = 0.15  # rad/s of the fastest joint
GENTLE = 1.0  # rad/s^2
SETTLED = 0.25  # s of standstill before the residual counts as that of a free arm
LEAD = 0.03  # s by which a force is extrapolated: about the delay of the observer
GROWTH = 0.02  # s over which the growth of the force is measured


SHORTEST = 40  # samples, shortest motion that counts
LONGEST = 4000  # samples, longest recorded motion; later samples belong to the next one


class MovingContact:
    """Processes every sample of lwr/joint_states; returns evidence of contact. The default payload is zero."""

    def __init__(
        self,
        thresholds: Thresholds,
        dynamics: Dynamics,
        jacobian: Callable[[Joints], np.ndarray],
        period: float = 0.0,
    ) -> None:
        """``jacobian``: converts joint positions (rad) to the palm's 3 x 7 matrix, base frame. ``period``: see
        MomentumObserver."""
        self.observer = MomentumObserver(dynamics, period=period)
        self.use(thresholds)
        self.load = 0.0
        self.change: Change | None = None
        """newest change"""
        self.residual: Residual | None = None
        """newest residual"""
        self._jacobian = jacobian
        self._changes = ChangeOfResidual(jacobian)
        self._newest: deque[Change] = deque(maxlen=CONFIRM)
        self._still_since: float | None = None
        self._rest: np.ndarray | None = None
        self._free: np.ndarray | None = None
        """mean residual of the rest before the motion"""
        self._rest_position, self._rest_stamp = np.zeros(7), 0.0
        self._free_weight: float | None = None  # N, load on the palm at that rest
        self._growing: deque[tuple[float, np.ndarray]] = deque()  # (s, Nm): residuals of the last GROWTH s

    def use(self, thresholds: Thresholds) -> None:
        """Use these thresholds, and the lag of the torques that was learnt with them."""
        self.thresholds = thresholds
        self.observer.lag = thresholds.lag

    def set_payload(self, mass: float, centre: Joints = (0.0, 0.0, 0.0)) -> None:
        """Set a payload of ``mass`` kg at ``centre`` (m, ih2_palm). The past is deleted, so that the arrival of the
        load is no contact. ValueError: invalid mass."""
        self.observer.set_payload(mass, centre)
        self.load = mass
        self._forget()

    def _forget(self) -> None:
        self._changes.reset()
        self._newest.clear()
        self._growing.clear()
        self.change = self._still_since = self._rest = self._free = self._free_weight = None

    def still(self) -> bool:
        """True if the arm has stood still for SETTLED s."""
        return self._rest is not None

    def offset(self) -> Offset | None:
        """Returns the recent mean residual minus that of the last rest before the motion; None without such a rest."""
        if self.change is None or self._free is None:
            return None
        return Offset(self._changes.past - self._free, self.change.jacobian)

    def offset_of_motion(self) -> Offset | None:
        """Returns the residual of this rest minus that of the rest before the motion; None while the arm moves."""
        if self.change is None or self._free is None or self._rest is None:
            return None
        return Offset(self._rest - self._free, self.change.jacobian)

    def steady(self) -> Evidence | None:
        """Returns the evidence from the offset: an early touch leaves an offset before the detector was armed."""
        offset = self.offset()
        if offset is None or self.change is None or self.load > 0.0:
            return None
        force, size = self.thresholds.steady_force(offset, self.change.features)
        stamp, margin = self.change.stamp, size / self.thresholds.steady_limit
        message = f"{length(force):.1f} N on the hand since the arm stood still: it was there already"
        return Evidence(MOMENTUM, stamp, stamp + HOLD, margin, message)

    def weight_since(self, before: np.ndarray) -> float:
        """Returns the weight (N) that has come to the palm since the residual was ``before`` (Nm), moving or not. It is
        the downward part of the force on the palm that explains the change best: a sideways pull is no weight."""
        assert self.residual is not None
        return self.weight(self.residual.torque - before, self.residual.position)

    def weight(self, residual: Joints, position: Joints) -> float:
        """Returns the weight (N) on the palm for a residual (Nm) at a position (rad): see weight_since."""
        return -float(np.linalg.lstsq(self._jacobian(position).T, residual, rcond=0.05)[0][2])

    def before_motion(self) -> np.ndarray | None:
        """Returns the mean residual (Nm) of the last rest before the present or last motion, or of this rest if the arm
        has not moved yet; None without such a rest."""
        return self._rest if self._free is None else self._free

    def force_since(self, before: np.ndarray) -> np.ndarray | None:
        """Returns the force (N) on the palm in the base frame, relative to the residual ``before`` (Nm), extrapolated
        by LEAD s. None before the first measurement."""
        if not self._growing or self.residual is None:
            return None
        (begin, first), (stamp, torque) = self._growing[0], self._growing[-1]
        growth = (torque - first) / (stamp - begin) if stamp > begin else np.zeros(7)
        ahead = torque + LEAD * growth - before
        return np.asarray(np.linalg.lstsq(self._jacobian(self.residual.position).T, ahead, rcond=0.05)[0])

    def weight_before_motion(self) -> float | None:
        """Returns the load (N) on the palm at the last rest before the present or last motion; None if unknown."""
        return self._free_weight

    def slow(self) -> bool:
        """True if the arm moves so slowly that errors of the model's inertia do not matter."""
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
        """Process one measured sample: s, rad, Nm. ``made``: see MomentumObserver.feed."""
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
        """Returns the evidence of the newest samples. None without a reference mean, or if the last sample was left
        out. Call it only while watching: the force behind a change is the most expensive computation here."""
        if self.residual is None or self.change is None:
            return None
        forces = [self.thresholds.force(change) for change in self._newest]
        force, size = forces[-1]
        sure = min(each for _, each in forces) if len(forces) == CONFIRM else 0.0
        message = f"{length(force):.1f} N on the hand, {size:.0f} deviations of the moving arm's"
        stamp = self.change.stamp
        return Evidence(MOMENTUM, stamp, stamp + HOLD, sure / self.thresholds.limit, message)


def unwritable(file: str) -> str:
    """Returns the reason why a file cannot be written, a sentence; empty if it can. The file is not touched: an empty
    one would be read at the next start."""
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
    """Records the motions of a MovingContact, for learning. Nobody may touch the arm meanwhile."""

    def __init__(self, moving: MovingContact) -> None:
        self.moving = moving
        self.reaches: list[list[Change]] = []
        self.offsets: list[Offset] = []
        self._reach: list[Change] = []
        self._stamp = 0.0

    def look(self) -> None:
        """Call this after each sample of the arm. One motion lasts from rest to rest."""
        change = self.moving.change
        if change is None or change.stamp == self._stamp:
            return
        self._stamp = change.stamp
        self._reach.append(change)
        resting = self.moving.still()
        if len(self._reach) >= LONGEST or (resting and self._moved()):
            self.end()
        elif resting:
            # Of the rest before a motion, only the last moment belongs to it, not the stop of the previous motion.
            self._reach = self._reach[-SHORTEST:]

    def _moved(self) -> bool:
        return max(change.features[0, 1] for change in self._reach) > 0.1

    def end(self) -> None:
        """End the motion and keep it if it was long enough."""
        if len(self._reach) >= SHORTEST and self._moved():
            self.reaches.append(self._reach)
            offset = self.moving.offset_of_motion()
            if offset is not None and self.moving.load == 0.0:
                self.offsets.append(offset)
        self._reach = []

    def learn(self) -> Thresholds:
        """Learn from the recorded motions. ThresholdError if there are too few."""
        return learn(self.reaches, self.offsets, lag=self.moving.thresholds.lag)
