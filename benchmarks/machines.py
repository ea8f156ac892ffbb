#!/usr/bin/python3
"""The state machine engine compared with that of the ROS distributions (PyPI's standalone-smach, if installed).

Transition: median of 30 runs of 1000 empty states. Preempts: requested at random moments of nested machines and
concurrences, also before the run; lost if the run does not end as preempted within 5 s.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import io
import random
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import smach
from common import Row, main

COUNT = 1000  # states


def transition_us() -> float:
    """Median time of a transition (us) of the imported smach."""
    machine = smach.StateMachine(["end"])
    with machine:
        for i in range(COUNT):
            target = f"S{i + 1}" if i + 1 < COUNT else "end"
            smach.StateMachine.add(f"S{i}", smach.CBState(lambda ud: "next", outcomes=["next"]), {"next": target})
    found = []
    for _ in range(30):
        begin = time.perf_counter()
        with contextlib.redirect_stdout(io.StringIO()):  # the default loggers print
            machine.execute()
        found.append((time.perf_counter() - begin) / COUNT * 1e6)
    return statistics.median(found)


def peer_us() -> float | None:
    """The same for the upstream engine, in its own process; None if it is not installed."""
    try:
        folder = importlib.metadata.distribution("standalone-smach").locate_file("")
    except importlib.metadata.PackageNotFoundError:
        return None
    code = f"import sys; sys.path[:0] = [{str(folder)!r}, {str(Path(__file__).parent)!r}]; sys.argv = ['x']; "
    code += "import machines; print(machines.transition_us(), file=sys.stderr)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True)
    return float(run.stderr.split()[-1])


def transitions(_quick: bool) -> Iterator[Row]:
    """One transition."""
    yield Row("one transition of a state machine", transition_us(), "us", "<= 50")
    peer = peer_us()
    if peer is not None:
        yield Row("the same on the engine of the ROS distributions", peer, "us")


class Hop(smach.State):
    """Checks the preempt flag once, then goes on."""

    def __init__(self) -> None:
        super().__init__(["on", "preempted"])

    def execute(self, ud: object) -> str:
        time.sleep(0.0002)
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        return "on"


def endless(depth: int) -> smach.StateMachine:
    """Concurrences in machines in concurrences that end only by a request."""
    machine = smach.StateMachine(["preempted"])
    with machine:
        smach.StateMachine.add("A", Hop(), {"on": "B"})
        if depth == 0:
            smach.StateMachine.add("B", Hop(), {"on": "A"})
        else:
            both = smach.Concurrence(["again", "preempted"], "again")
            with both:
                smach.Concurrence.add("LEFT", endless(depth - 1))
                smach.Concurrence.add("RIGHT", endless(0))
            smach.StateMachine.add("B", both, {"again": "A"})
    return machine


def preempts(quick: bool) -> Iterator[Row]:
    """Preempts at random moments."""
    smach.set_loggers(*[lambda message: None] * 4)
    chance, machine, lost, number = random.Random(7), endless(2), 0, 300 if quick else 10_000
    for _ in range(number):
        outcome: list[str | None] = []
        thread = threading.Thread(target=lambda outcome=outcome: outcome.append(machine.execute()))
        moment = chance.random() * 0.004
        if moment < 0.0004:
            machine.request_preempt()  # before the run
            thread.start()
        else:
            thread.start()
            time.sleep(moment)
            machine.request_preempt()
        thread.join(5.0)
        if thread.is_alive() or outcome != ["preempted"]:
            lost += 1
            while thread.is_alive():
                machine.request_preempt()
                thread.join(0.1)
    yield Row("preempts lost at random moments of nested machines", lost, "", "<= 0", f"of {number}")


if __name__ == "__main__":
    main("machines", transitions, preempts)
