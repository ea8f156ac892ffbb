"""One seeded failure in a whole trial in virtual time: which machine, at which moment, how; and whether the arm moved
afterwards."""

import numpy as np
import smach
from coglab_smach.ports.pending import PortError
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_trials.trial import VirtualTrial
from motion_watch import MotionWatch

HOLDING = {"exchange_robot_to_human": "exchange_human_to_robot", "put": "take"}
"""action -> the one that brings the object into the hand before it"""
DURATION = {
    "coglab_init_system": 5.0,
    "exchange_human_to_robot": 9.0,
    "exchange_robot_to_human": 8.0,
    "take": 12.0,
    "put": 11.0,
}
"""s, about what each takes: the moment is drawn from it"""
MACHINES = [*DURATION, "recover"]
KINDS = ("failure", "time limit", "preemption")


class SeededFailure:
    """``run()`` walks the trial; then ``happened`` says where, and ``watch.moved`` what moved all the same."""

    def __init__(self, seed):
        draw = np.random.default_rng([20, seed])
        self.machine = MACHINES[seed % len(MACHINES)]
        self.kind = KINDS[seed // len(MACHINES) % len(KINDS)]
        self.action = self.machine if self.machine != "recover" else list(DURATION)[1 + int(draw.integers(4))]
        self.moment = float(draw.uniform(0.0, DURATION[self.action]))
        # In a recovery: how long after its first state has begun.
        self.later = float(draw.uniform(0.0, 3.0))
        board = self.action in ("take", "put")
        smach.set_loggers(*[lambda *a: None] * 4)
        where = "world" if board else "human_hand"
        self.trial = VirtualTrial(seed=3000 + seed, object_on=where)
        self.happened = ""
        self._due = None
        self._recovery = self._waited = False
        self.watch = MotionWatch(self.trial.ctx, lambda: self.trial.rig.cell.truth()["velocity"])
        self.trial.beside = self._beside

    def run(self):
        """The trial, and 0.5 s of the world after the machine has ended. Returns whether the arm moved."""
        check = CoglabState.check

        def checked(state):
            check(state)
            self._strike(state)

        CoglabState.check = checked
        try:
            self.trial.run(script=self._script)
        finally:
            CoglabState.check = check
        for _ in range(100):
            self.trial.rig.step()
            self.watch.look()
        return bool(self.watch.moved)

    def _script(self, trial):
        journal = trial.ctx.journal
        if self.action != "coglab_init_system":
            before = HOLDING.get(self.action)
            trial.wait_hub("wait_without_object")
            if before is not None:
                assert trial.ctx.requests.submit(before, "mug").ok
                trial.wait_hub("wait_with_object")
            assert trial.ctx.requests.submit(self.action, "mug").ok
        self._due = trial.clock.now() + self.moment
        end = trial.clock.now() + 90.0
        done = len(journal.results)
        while trial.clock.now() < end and len(journal.results) == done:
            trial.clock.sleep(0.05)
        trial.clock.sleep(1.0)

    def _beside(self, trial):
        self.watch.look()

    def _strike(self, state):
        """Called in every look of every state: the moment has come, and this is the machine that was drawn."""
        now, path = self.trial.clock.now(), f"{state.path()}/"
        if self._due is None or now < self._due or state.label == "monitor_dmp" or f"/{self.action}/" not in path:
            return
        recovers = "/recover/" in path
        if self.machine == "recover" and not self._recovery:
            if not recovers:  # what fails first makes the machine recover; the failure that counts comes in there
                self._recovery = True
                raise PortError("first failure of the bench")
            return
        if self.machine == "recover" and self._recovery and not self._waited:
            self._waited, self._due = True, now + self.later
            return
        if recovers != (self.machine == "recover"):
            return
        self._due, self.happened = float("inf"), f"{self.kind} in {state.path()}/{state.label}"
        if self.kind == "preemption":
            self.trial.master.request_preempt()
            return
        raise PortError("failure of the bench") if self.kind == "failure" else TimeLimit("time limit of the bench")
