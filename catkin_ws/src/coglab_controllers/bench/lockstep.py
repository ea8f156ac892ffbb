"""The random reaches through bridge, controller manager and the stand-in for the robot controller, in lockstep.

Needs the robot in virtual time of coglab_sim; without it the bench reports the interpolator alone.
"""

from dataclasses import dataclass

import numpy as np

from core_bench import LIMITS, PRIMITIVES, URDF

try:
    from coglab_sim import _cell, _virtual  # noqa: F401  (_cell knows the types that _virtual uses)
except ImportError:  # optional: the simulated cell is a package of its own
    _virtual = None

PERIOD, FRAME_PERIOD = 0.005, 0.03
FOLDED = np.array([0.0, 0.0, 0.0, 1.9, 0.0, 0.0, 0.0])
APPROACH_LIMIT, REACH_LIMIT, WATCHED = 20.0, 6.0, 0.5  # s of simulated time


@dataclass
class LockstepReach:
    """Distance of the hand from its goal 0.5 s after the end (m), duration (s), largest joint speed over its
    limit."""

    last: float
    duration: float
    over: float


class Robot:
    """The whole robot in virtual time, started and with both motion controllers loaded."""

    def __init__(self, limits) -> None:
        self.limits = limits
        self.robot = _virtual.VirtualRobot(str(URDF), str(LIMITS), {"krc/period": PERIOD, "seed": 1})
        for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
            self.must(self.robot.load_controller(name, kind))
        self.must(self.robot.load_dmps(str(PRIMITIVES)))
        self.wait(lambda: self.robot.cell.quality == 3, 5.0)
        ticket = self.robot.submit("start")
        answers: list[tuple] = []  # an outcome is told once
        self.wait(lambda: (answer := self.robot.outcome(ticket)) is not None and not answers.append(answer), 10.0)
        self.must(answers[0])

    @staticmethod
    def must(answer: tuple) -> None:
        """Raises what a service refused."""
        if not answer[0]:
            raise RuntimeError(answer[1])

    def wait(self, condition, limit: float) -> None:
        """Advances until the condition holds; raises TimeoutError after `limit` s of simulated time."""
        end = self.robot.now + limit
        while not condition():
            if self.robot.now > end:
                raise TimeoutError(f"the simulated robot did not get ready within {limit} s")
            self.robot.advance(PERIOD)

    def approach(self, posture: np.ndarray) -> bool:
        """Point to point to a posture, by way of a folded one if need be; False if it is not reached."""
        return self.move(posture) or (self.move(FOLDED) and self.move(posture))

    def move(self, posture: np.ndarray) -> bool:
        """Point to point; False if it is refused or blocked (workspace, joint limits)."""
        self.must(self.robot.switch_controller("ptp"))
        speeds, accelerations = 0.9 * self.limits.velocity, 0.5 * self.limits.acceleration
        status, _, _ = self.robot.add_ptp(list(posture), list(speeds), list(accelerations))
        if status == 2:
            return False
        end = self.robot.now + APPROACH_LIMIT
        while self.robot.now < end:
            self.robot.advance(FRAME_PERIOD)
            if self.robot.report()["motion"] == "aborted":
                return False
            if np.abs(self.robot.report()["position"] - posture).max() < 2e-3:
                self.robot.advance(0.3)
                return True
        return False

    def reach(self, goal: np.ndarray, target: np.ndarray) -> LockstepReach | None:
        """One DMP motion to a goal frame; None if it is refused or aborted."""
        self.must(self.robot.switch_controller("dmp"))
        self.robot.set_frame("goal", goal, target)
        identity = [0.0, 0.0, 0.0, 1.0]
        answer = self.robot.execute_dmp(
            "reach_human", orientation_control=True, target_orientation=identity, goal_frame="goal"
        )
        if not answer[0]:
            return None
        begin, over, watched = self.robot.now, 0.0, 0.0
        duration = REACH_LIMIT
        while watched < WATCHED:
            self.robot.set_frame("goal", goal, target)
            for _ in range(round(FRAME_PERIOD / PERIOD)):
                self.robot.tick()
                over = max(over, float(np.max(np.abs(self.robot.cell.velocity) / self.limits.velocity)))
            motion = self.robot.report()["motion"]
            if motion == "aborted" or self.robot.now - begin > REACH_LIMIT:
                return None
            if motion == "reached":
                duration = min(duration, self.robot.now - begin)
                watched += FRAME_PERIOD
        hand = self.robot.cell.truth()["robot_hand"]["position"]
        return LockstepReach(float(np.linalg.norm(hand - goal)), duration, over)
