"""What truly happened in a trial, period by period, of the cell itself: nothing here asks the machines how it went.

Of the person: the hand's own speed, without sway and tremor, and how far the fingers are closed; of the robot: the
palm as the plant has it, and the forces on palm and phalanges that the physics has computed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import motion_figures
import numpy as np
from campaign import EXCHANGES
from coglab_py.pose import Pose
from coglab_sim.virtual_world import DT
from reach_figures import human_time, sparc

RATE = 1.0 / DT
TOUCH = 0.5
"""N on palm and fingers, from which something touches the robot's hand"""
CARRIED, MOST = 0.5, 0.9
"""shares of the weight on the robot's hand from which it carries the object, and carries most of it"""
AT_TOUCH = 0.10
"""s of contact of which the largest force counts as that at touch"""
NEAR = 0.25
"""m from the palm to the person's hand"""
FREE = 0.20
"""s after a withdrawal or a fall in which the arm may still go on"""
TAKER = 0.20
"""s after the onset of the person's reach at which a human taker starts"""
CALMS = 0.5
"""s after its end at most that a reach's own braking belongs to it"""
RECEIVE, GIVE = EXCHANGES
UNDER_WAY = ("running", "holding")


@dataclass
class Series:
    """A row of each for every FRI period of the robot."""

    time: list[float] = field(default_factory=list)
    """s, as in the journal"""
    palm: list[np.ndarray] = field(default_factory=list)
    velocity: list[np.ndarray] = field(default_factory=list)
    """m/s, of the palm"""
    hand: list[np.ndarray] = field(default_factory=list)
    thing: list[np.ndarray] = field(default_factory=list)
    """m, middle of the object"""
    reaching: list[float] = field(default_factory=list)
    """m/s, own speed of the person's hand"""
    grip: list[float] = field(default_factory=list)
    force: list[float] = field(default_factory=list)
    """N, of all that touches palm and phalanges; where these touch one another it is nothing"""
    pull: list[float] = field(default_factory=list)
    """N, of the object on the robot's hand"""
    share: list[float] = field(default_factory=list)
    held_by: list[str] = field(default_factory=list)
    moving: list[bool] = field(default_factory=list)
    """a DMP motion is under way"""

    def between(self, begin: int, end: int) -> dict[str, np.ndarray]:
        """As arrays, from one index to before another."""
        return {name: np.array(values[begin:end]) for name, values in vars(self).items()}


class TrueTrace:
    """Watches a VirtualTrial from its beginning; ``figures`` once it is over."""

    def __init__(self, trial: Any) -> None:
        self.trial, self.rig = trial, trial.rig
        self.series = Series()
        self.begun: list[int] = []
        """index in the series at which each action began"""
        self.codes: list[tuple[float, int]] = []
        """when (s) and as which ReasonCode a state failed"""
        self.event: float | None = None
        """s, when the person begins to withdraw or the object leaves the hand, in trials in which that happens"""
        self.gone: float | None = None
        """s, when that has happened: the hand is back by 0.10 m, or the object has left it"""
        self.sample = None
        self._middle = self.rig.scene.object_middle
        trial.beside = self.look
        trial.ctx.journal.listen(self._on_transition)
        self.watch_person()

    @property
    def now(self) -> float:
        """s of the machines' clock, which is not the robot's."""
        return float(self.trial.clock.now())

    def watch_person(self) -> None:
        """Keep what the person's hand does in each step."""
        step = self.rig.human.step

        def watched(t: float, view: Any) -> Any:
            self.sample = step(t, view)
            return self.sample

        self.rig.human.step = watched

    def _on_transition(self, record: Any) -> None:
        if record.outcome == "failed" and record.code:
            self.codes.append((record.stamp, record.code))

    def look(self, trial: Any) -> None:
        """After each period of the world."""
        rig, cell, series = self.rig, self.rig.cell, self.series
        if self.sample is None or rig.robot.report["fri_period"] <= 0.0:
            return
        truth = cell.truth()
        forces = np.array(list(cell.touch().values()))
        series.time.append(self.now)
        series.palm.append(np.array(truth["robot_hand"]["position"]))
        series.velocity.append(rig.robot.chain.jacobian(truth["position"])[:3] @ truth["velocity"])
        series.hand.append(np.array(truth["human_hand"]["position"]))
        thing = truth["object"]
        series.thing.append(Pose(np.array(thing["position"]), np.array(thing["rotation"])).apply(self._middle))
        series.reaching.append(float(np.linalg.norm(self.sample.velocity)))
        series.grip.append(float(self.sample.grip))
        series.force.append(float(np.linalg.norm(np.sum(forces, axis=0))))
        series.pull.append(float(np.linalg.norm(truth["palm_force"])))
        series.share.append(float(truth["robot_load_share"]))
        series.held_by.append(truth["held_by"])
        series.moving.append(rig.robot.virtual.dmp_progress()["motion"] in UNDER_WAY)
        if len(trial.begun) > len(self.begun):
            self.begun.append(len(series.time) - 1)

    def figures(self) -> list[dict[str, Any]]:
        """Of each action that had begun, plain data: see ``of_action``, ``reaches_of`` and ``of_receiving``."""
        results = [r for r in self.trial.ctx.journal.results if r.kind in self.trial.begun]
        found = []
        for k, begin in enumerate(self.begun):
            action, last = self.trial.begun[k], len(self.series.time)
            ended = results[k].ended if k < len(results) else np.inf
            end = min(last, int(np.searchsorted(self.series.time, ended)) + 1)
            part = self.series.between(begin, max(end, begin + 1))
            one = {"action": action, **of_action(part, action), **after_event(part, self.event, self.gone)}
            one["reaches"] = reaches_of(part, action, self.codes)
            found.append(one | (of_receiving(part, one) if action == RECEIVE else {}))
        return found


def toward_of(part: dict[str, np.ndarray], what: str) -> np.ndarray:
    """m/s, of the palm toward the person's ``hand`` or the ``thing``."""
    way = part[what] - part["palm"]
    return np.sum(part["velocity"] * way, axis=1) / np.maximum(np.linalg.norm(way, axis=1), 1e-9)


def after_event(part: dict[str, np.ndarray], event: float | None, gone: float | None) -> dict[str, Any]:
    """Of a withdrawal or a fall that began at ``event`` and had happened at ``gone`` (s; None: never): ``event``;
    ``chase`` and ``chase_at_once``: m/s, largest speed of the palm toward hand or object from 0.2 s after ``gone`` and
    after ``event`` on; ``moved_before``: the arm had moved. Nothing where nothing began."""
    if event is None:
        return {}
    toward = np.maximum(toward_of(part, "hand"), toward_of(part, "thing"))

    def after(moment: float | None) -> float:
        late = part["time"] > (np.inf if moment is None else moment) + FREE - 1e-9
        return float(np.max(toward[late], initial=0.0))

    arm = motion_figures.onset(np.linalg.norm(part["velocity"], axis=1), RATE)
    before = arm is not None and part["time"][arm] < event
    return {"event": event, "chase": after(gone), "chase_at_once": after(event), "moved_before": bool(before)}


def of_action(part: dict[str, np.ndarray], action: str) -> dict[str, Any]:
    """``held_by`` at the end of the action; ``onset`` and ``arm_onset`` (s): when the person's hand and the palm begin
    to move; ``near_speed``: m/s, largest speed of the palm toward the person's hand near it; ``pull``: N, largest force
    of the object on the robot's hand while the person holds it, too."""
    times, away = part["time"], np.linalg.norm(part["hand"] - part["palm"], axis=1)
    near = toward_of(part, "hand")[away < NEAR]
    onset = motion_figures.onset(part["reaching"], RATE)
    arm = motion_figures.onset(np.linalg.norm(part["velocity"], axis=1), RATE)
    pulled = part["pull"][(part["held_by"] == "both") | (part["grip"] > 0.5)]
    return {
        "held_by": str(part["held_by"][-1]),
        "onset": None if onset is None else float(times[onset]),
        "arm_onset": None if arm is None else float(times[arm]),
        "near_speed": float(np.max(near, initial=0.0)),
        "pull": float(np.max(pulled, initial=0.0)),
    }


def of_receiving(part: dict[str, np.ndarray], found: dict[str, Any]) -> dict[str, Any]:
    """``touch_late``: s from the touch of a human taker to that of the robot; ``carry``, ``carry_most``: s from touch
    until the robot holds, and carries half or nine tenths of the weight; ``holding_on``: s from the person's hand at
    rest (or touched) until it lets go; ``touch_force``: N; ``touch_moving``: the palm moved then. None: never."""
    names = ("touch_late", "carry", "carry_most", "holding_on", "touch_force", "touch_moving")
    out: dict[str, Any] = dict.fromkeys(names)
    times = part["time"]
    if found["onset"] is None:
        return out
    begin = int(np.searchsorted(times, found["onset"] - 1e-9))
    touches = np.flatnonzero(part["force"][begin:] >= TOUCH)
    touch = begin + int(touches[0]) if len(touches) else None
    stood = motion_figures.rest(part["reaching"][begin:], RATE)
    there = len(times) - 1 if stood is None else begin + stood
    there = there if touch is None else min(there, touch)
    grips = np.flatnonzero(part["grip"][there:] < 0.5)
    if len(grips):
        out["holding_on"] = float(times[there + grips[0]] - times[there])
    if touch is None:
        return out
    way = float(np.linalg.norm(part["thing"][there] - part["palm"][0]))
    taker = max(found["onset"] + TAKER + human_time(way), float(times[there]))
    out["touch_late"] = float(times[touch] - taker)
    out["touch_force"] = float(np.max(part["force"][touch : touch + round(AT_TOUCH * RATE)]))
    out["touch_moving"] = bool(np.linalg.norm(part["velocity"][touch]) > motion_figures.MOVES)
    for name, least in (("carry", CARRIED), ("carry_most", MOST)):
        holds = np.isin(part["held_by"], ("robot", "both")) & (part["share"] >= least)
        carried = motion_figures.onset(np.where(holds[touch:], 1.0, 0.0), RATE)
        if carried is not None:
            out[name] = float(times[touch + carried] - times[touch])
    return out


def reaches_of(part: dict[str, np.ndarray], action: str, codes: list[tuple[float, int]]) -> list[dict[str, Any]]:
    """Of each DMP motion of the action: how it ended (ReasonCode of what failed then, 0: nothing did), whether the palm
    moved at all, ``wrong_mm``, ``detour``, ``peaks``, ``sparc``, ``straight`` (m)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], part["moving"].astype(int), [0]])))
    found = []
    begins = [*edges[::2], len(part["time"])]
    for k, (begin, stop) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        after = np.linalg.norm(part["velocity"][stop : stop + round(CALMS * RATE)], axis=1)
        calm = np.flatnonzero(after <= motion_figures.MOVES)
        end = min(stop + (int(calm[0]) if len(calm) else len(after)) + 1, len(part["time"]))
        low, high = part["time"][begin], part["time"][min(begins[k + 1], len(part["time"]) - 1)]
        code = next((code for stamp, code in codes if low <= stamp <= high), 0)
        found.append({"code": code, **of_reach({k: v[begin:end] for k, v in part.items()}, action)})
    return found


def of_reach(part: dict[str, np.ndarray], action: str) -> dict[str, Any]:
    """The figures of one reach; see ``reaches_of``. Its wrong way counts until something touches the hand, or the
    person the object in it: what pushes the palm then is not the arm."""
    path, speed = part["palm"], np.linalg.norm(part["velocity"], axis=1)
    met = part["force"] >= TOUCH if action == RECEIVE else part["held_by"] == "both"
    until = int(np.argmax(met)) + 1 if met.any() else len(path)
    moved = motion_figures.onset(speed, RATE) is not None
    return {
        "moved": moved,
        "straight": float(np.linalg.norm(path[-1] - path[0])),
        "wrong_mm": 1000.0 * motion_figures.wrong_way(motion_figures.along(path)[:until]),
        "detour": motion_figures.detour(path) if moved else None,
        "peaks": motion_figures.peaks(speed, RATE) if moved else 0,
        "sparc": sparc(speed, RATE) if moved else None,
    }
