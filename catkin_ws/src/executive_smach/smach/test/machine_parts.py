"""States for the tests."""

import threading
import time

import smach


class Says(smach.State):
    """Returns the given outcomes, one per run; then always the last one."""

    def __init__(self, *outcomes, registered=None, **keys):
        super().__init__(outcomes=registered or [o for o in outcomes if o], **keys)
        self.script = list(outcomes)
        self.runs = 0
        self.seen = []  # whether a preempt was requested on entry

    def execute(self, ud):
        self.seen.append(self.preempt_requested())
        return self.next_outcome()

    def next_outcome(self):
        outcome = self.script[min(self.runs, len(self.script) - 1)]
        self.runs += 1
        return outcome


class Ignores(Says):
    """Requests `machine` to end during its own run, and returns without serving the request."""

    machine = None

    def execute(self, ud):
        self.seen.append(self.preempt_requested())
        if self.machine is not None:
            self.machine.request_preempt()
        return self.next_outcome()


class Serves(Says):
    """Serves a request that is there on entry or comes within `patience` s; else returns its
    outcome.
    """

    def __init__(self, outcome="done", patience=0.0):
        super().__init__(outcome, registered=[outcome, "preempted"])
        self.patience = patience
        self.started = threading.Event()

    def execute(self, ud):
        self.started.set()
        limit = time.monotonic() + self.patience
        outcome = super().execute(ud)
        while True:
            if self.preempt_requested():
                self.service_preempt()
                return "preempted"
            if time.monotonic() >= limit:
                return outcome
            time.sleep(0.0005)


class Raises(smach.State):
    """Raises the given exception."""

    def __init__(self, error):
        super().__init__(outcomes=["done"])
        self.error = error

    def execute(self, ud):
        raise self.error


class Calls(smach.State):
    """Returns what a function of the user data returns."""

    def __init__(self, function, outcomes=("done",), **keys):
        super().__init__(outcomes=outcomes, **keys)
        self.function = function

    def execute(self, ud):
        return self.function(ud) or "done"


def machine(*states, outcomes=("done", "preempted"), transitions=None, **kwargs):
    """A machine of states S0, S1, ...: 'done' leads on, everything else out."""
    result = smach.StateMachine(outcomes=outcomes, **kwargs)
    with result:
        for index, state in enumerate(states):
            edges = {}
            if "done" in state.get_registered_outcomes() and index + 1 < len(states):
                edges["done"] = f"S{index + 1}"
            edges.update((transitions or {}).get(index, {}))
            smach.StateMachine.add(f"S{index}", state, transitions=edges)
    return result


def in_thread(function):
    """Runs `function` in a thread; result of .join() is kept in .result, an exception in .error."""

    class Runner(threading.Thread):
        result = error = None

        def run(self):
            try:
                self.result = function()
            except BaseException as error:
                self.error = error

    runner = Runner(daemon=True)
    runner.start()
    return runner


def wait_for(condition, limit=60.0):
    """True if `condition()` becomes true within `limit` s."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.002)
    return bool(condition())


def concurrence(outcomes=("done", "failed", "preempted"), default="failed", children=None, **kwargs):
    """A Concurrence of these children."""
    result = smach.Concurrence(outcomes=list(outcomes), default_outcome=default, **kwargs)
    with result:
        for label, state in (children or {}).items():
            smach.Concurrence.add(label, state)
    return result


ALL_DONE = {"done": {"A": "done", "B": "done"}}
