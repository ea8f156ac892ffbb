"""Checks that nothing moves after a failure, for tests and benches.

A state ends with failed or preempted. From the start of the next state (or the end of the machine), until a new motion
is accepted or the trial is over, the true speed of every joint must stay below STILL.
"""

import numpy as np
from coglab_smach.ports.pending import PortError

STILL = 0.02
"""rad/s, the contact detector's limit for an arm at rest"""


class MotionWatch:
    """Checks the arm's true velocity. ``velocity()`` returns it (rad/s, seven joints); ``look()`` is called in every
    step of the world, in the clock's time."""

    def __init__(self, ctx, velocity):
        self._velocity = velocity
        self._failed = self._watching = False
        self._asked_for = []
        """motion requests since the failure that are neither accepted nor refused yet"""
        self.failures = 0
        """states that have ended failed or preempted"""
        self.moved = []
        """(running state, rad/s) of each forbidden motion"""
        self._journal = ctx.journal
        ctx.journal.listen(self._on_transition)
        ctx.journal.listen_changes(self._on_change)
        for name in ("move_ptp", "execute_dmp", "switch_dmp"):
            setattr(ctx.arm, name, self._asked(getattr(ctx.arm, name)))

    def _asked(self, call):
        def ask(*arguments):
            pending = call(*arguments)
            if self._failed:
                self._asked_for.append(pending)
            return pending

        return ask

    def _on_transition(self, record):
        if self._failed and record.outcome == "preempted" and record.path.count("/") == 1:
            self._watching = True  # the machine is at its end: no state follows
            self.look()
        if record.outcome in ("failed", "preempted") and record.from_state != "monitor_dmp":
            self.failures += 1
            self._failed = True
            self._asked_for.clear()

    def _on_change(self):
        # A new state has begun, and no parallel state of the failed group is left.
        if self._failed and len(self._journal.active()) == 1:
            self._watching = True
            self.look()

    def _accepted(self, pending, moves):
        """True if a motion was accepted; None: not known yet. The handle of a motion reports it only at its end, but
        then the arm has moved."""
        if not pending.done():
            return True if moves else None
        try:
            pending.result()
        except PortError:
            return False
        return True

    def look(self):
        """Record a motion of the arm while it must stand."""
        if not self._failed:
            return
        speed = float(np.max(np.abs(self._velocity())))
        answers = [(pending, self._accepted(pending, speed > STILL)) for pending in self._asked_for]
        self._asked_for = [pending for pending, accepted in answers if accepted is None]
        if any(accepted for _, accepted in answers):
            self._watching = self._failed = False
        if self._watching and speed > STILL:
            self.moved.append((", ".join(self._journal.active()), speed))
