#!/usr/bin/python3
"""Figures of the state machine engine and of its introspection, as a JSON list on stdout.

Definitions, nothing is left out. Heartbeats and structures: one of each container is due every 2 s from the viewer's
connection to the end, whether it was sent or not, and each that the server sends beyond that. The two topics connect at
moments of their own and are counted apart: a round of beats may be for the one alone that is spared no longer (1.5 s
after its connection). Before, such a round was due on both, so that one of each container was missing that nobody sent.
Statuses: each start, transition and end that happened. What arrives twice counts once. Idle: processor time over 30 s,
one viewer connected. A transition: median of 30 runs of 1000, beside a bare loop in the same run; in a node, of 15 runs
of 100, judged by the median difference to rospy.loginfo alone. Preempts: 10 000 at random moments, also before the run;
lost: the run does not end as preempted within 5 s.

Starts a master of its own on a free port of 127.0.0.1 and ends it. Takes about three minutes.
`--quick` shortens all phases, for a look; its figures are not the ones to show.
"""

from __future__ import annotations

import collections
import contextlib
import io
import json
import os
import random
import socket
import statistics
import subprocess
import sys
import threading
import time
from typing import Any

import smach

QUICK = "--quick" in sys.argv
RUN_SECONDS = 6.0 if QUICK else 60.0
IDLE_SECONDS = 6.0 if QUICK else 30.0
PREEMPTS = 300 if QUICK else 10_000
CONTAINERS = 50
LIMIT = 30.0  # s, of every wait


# Machines.


class Tick(smach.State):
    """Takes `seconds`; ends early if asked; ends the second time with 'twice'."""

    def __init__(self, seconds: float) -> None:
        super().__init__(["once", "twice", "preempted"])
        self.seconds, self.count = seconds, 0

    def execute(self, ud: object) -> str:
        time.sleep(self.seconds)
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        self.count += 1
        return "once" if self.count % 2 else "twice"


def nested(depth: int, seconds: float) -> smach.StateMachine:
    """`depth` machines, each in the one before; every one runs its child twice before it ends."""
    machine = smach.StateMachine(["done", "preempted"])
    with machine:
        if depth > 1:
            smach.StateMachine.add("CHILD", nested(depth - 1, seconds), {"done": "TICK"})
        smach.StateMachine.add("TICK", Tick(seconds), {"once": "CHILD" if depth > 1 else "TICK", "twice": "done"})
    return machine


def all_containers(container: smach.Container, path: str):
    yield path, container
    for label, child in container.get_children().items():
        if isinstance(child, smach.Container):
            yield from all_containers(child, f"{path}/{label}")


class Hop(smach.State):
    """One look at the flag, then on."""

    def __init__(self) -> None:
        super().__init__(["on", "preempted"])

    def execute(self, ud: object) -> str:
        time.sleep(0.0002)
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        return "on"


def endless(depth: int) -> smach.StateMachine:
    """Concurrences in machines in concurrences, which end by a request only."""
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


def flags_up(state: smach.State) -> int:
    count = int(state.preempt_requested())
    if isinstance(state, smach.Container):
        count += sum(map(flags_up, state.get_children().values()))
    return count


# Figures without ROS.


def chain(count: int) -> tuple[smach.StateMachine, list[smach.State]]:
    """A machine of `count` states that do nothing, and the states."""
    states: list[smach.State] = [smach.CBState(lambda ud: "next", outcomes=["next"]) for _ in range(count)]
    machine = smach.StateMachine(["end"])
    with machine:
        for i, state in enumerate(states):
            target = f"S{i + 1}" if i + 1 < count else "end"
            smach.StateMachine.add(f"S{i}", state, {"next": target})
    return machine, states


def transition_cost() -> tuple[float, float]:
    """Median microseconds of a transition, and of a bare loop over the same states."""
    count = 1000
    machine, states = chain(count)
    ours, bare = [], []
    ud = smach.UserData()
    for _ in range(30):
        begun = time.perf_counter()
        with contextlib.redirect_stdout(io.StringIO()):  # the default loggers format and print
            machine.execute()
        middle = time.perf_counter()
        for state in states:
            state.execute(ud)
        ours.append((middle - begun) / count * 1e6)
        bare.append((time.perf_counter() - middle) / count * 1e6)
    return statistics.median(ours), statistics.median(bare)


def logged_transition_cost() -> tuple[float, float, float]:
    """Median microseconds of a transition in a node, of one rospy.loginfo, of the difference."""
    import rospy

    count = 100
    machine, _ = chain(count)
    ours, bare = [], []
    for _ in range(15):
        begun = time.perf_counter()
        machine.execute()
        middle = time.perf_counter()
        for i in range(count):
            rospy.loginfo(f"State machine transitioning 'S{i}':'next'-->'S{i + 1}'")
        ours.append((middle - begun) / count * 1e6)
        bare.append((time.perf_counter() - middle) / count * 1e6)
    extra = statistics.median(a - b for a, b in zip(ours, bare, strict=True))
    return statistics.median(ours), statistics.median(bare), extra


def preempt_campaign() -> tuple[int, int]:
    """How many of the preempts at random moments were lost, and how many flags were left over."""
    smach.set_loggers(*[lambda message: None] * 4)
    seed = random.Random(7)
    machine = endless(2)
    lost = left = 0
    for _ in range(PREEMPTS):
        outcome: list[str | None] = []
        thread = threading.Thread(target=lambda outcome=outcome: outcome.append(machine.execute()))
        moment = seed.random() * 0.004
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
        left += flags_up(machine)
    return lost, left


# Figures of introspection: a node with the machine, and this process as the viewer.


def tasks() -> int:
    return len(os.listdir("/proc/self/task"))


def node_main() -> None:
    """The process under test; prints one JSON line with what it has sent."""
    import rospy
    import smach_ros

    rospy.init_node("bench_smach_node")
    logged = logged_transition_cost()
    smach.set_loggers(*[lambda message: None] * 4)
    machine = nested(CONTAINERS, 0.02)
    sent: collections.Counter[str] = collections.Counter()
    rounds = [0, 0]  # of structures, of heartbeats
    time.sleep(1.0)
    threads_before = tasks()
    server = smach_ros.IntrospectionServer("/bench", machine, "/SM_ROOT")
    for path, container in all_containers(machine, "/SM_ROOT"):

        def count(*_args: object, path: str = path) -> None:
            sent[path] += 1

        container.register_start_cb(count)
        container.register_transition_cb(count)
        container.register_termination_cb(count)
        container.register_end_cb(count)
    publish = server._publish_heartbeats

    def counted(now: float) -> None:
        # A viewer of one topic may still be spared when that of the other is not.
        for i, viewers in enumerate(server._viewers):
            viewers.look(now)
            rounds[i] += any(now >= since + smach_ros.introspection.WELCOME_DELAY for since in viewers._since.values())
        publish(now)

    def connected() -> bool:
        topics = (server._status_pub, server._structure_pub)
        return all(topic.get_num_connections() > 0 for topic in topics)

    server._publish_heartbeats = counted
    server.start()
    limit = time.monotonic() + LIMIT
    while not connected() and time.monotonic() < limit:
        time.sleep(0.01)
    connected_at = time.monotonic()
    time.sleep(3.0)
    cpu, begun = time.process_time(), time.monotonic()
    time.sleep(IDLE_SECONDS)
    idle = (time.process_time() - cpu) / (time.monotonic() - begun) * 100.0
    extra = tasks() - threads_before
    runner = threading.Thread(target=machine.execute)
    runner.start()
    time.sleep(RUN_SECONDS)
    machine.request_preempt()
    runner.join(LIMIT)
    # A beat that was never sent is missed as well: one is due every 2 s of the whole time.
    due = int((time.monotonic() - connected_at) / smach_ros.introspection.HEARTBEAT)
    rounds = [max(due, count) for count in rounds]
    server.stop()
    report = {"sent": sent, "rounds": rounds, "idle": idle, "extra": extra, "logged": logged}
    print("REPORT " + json.dumps(report), flush=True)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def introspection_figures() -> dict[str, Any]:
    port = free_port()
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    os.environ.pop("ROS_HOSTNAME", None)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], **quiet)
    try:
        limit = time.monotonic() + LIMIT
        while time.monotonic() < limit:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
                break
            time.sleep(0.1)
        return watch()
    finally:
        master.terminate()
        master.wait(LIMIT)


def watch() -> dict[str, Any]:
    import rospy
    from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

    rospy.init_node("bench_smach_viewer", disable_signals=True)
    beats: collections.Counter[str] = collections.Counter()
    structures: collections.Counter[str] = collections.Counter()
    moves: collections.Counter[str] = collections.Counter()

    def on_status(message: SmachContainerStatus) -> None:
        if message.info == "HEARTBEAT":
            beats[message.path] += 1
        elif message.info != "Initial state":
            moves[message.path] += 1

    rospy.Subscriber("/bench/smach/container_status", SmachContainerStatus, on_status)
    rospy.Subscriber(
        "/bench/smach/container_structure",
        SmachContainerStructure,
        lambda message: structures.update([message.path]),
    )
    command = [sys.executable, os.path.abspath(__file__), "--node", *(["--quick"] if QUICK else [])]
    node = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        output, _ = node.communicate(timeout=RUN_SECONDS + IDLE_SECONDS + 4 * LIMIT)
    finally:
        node.kill()
        node.wait()
    report = json.loads(next(line for line in output.splitlines() if line.startswith("REPORT "))[7:])
    time.sleep(1.0)
    rospy.signal_shutdown("done")
    rounds = report["rounds"]
    beats_sent = CONTAINERS * sum(rounds)
    beats_got = sum(min(c, n) for counter, n in zip((structures, beats), rounds, strict=True) for c in counter.values())
    moves_got = sum(min(moves[path], count) for path, count in report["sent"].items())
    return {
        "beats": 100.0 * beats_got / beats_sent,
        "moves": 100.0 * moves_got / sum(report["sent"].values()),
        "moves_sent": sum(report["sent"].values()),
        "beats_sent": beats_sent,
        "idle": report["idle"],
        "extra": report["extra"],
        "logged": report["logged"],
    }


def row(figure: str, value: float, unit: str, goal: str, ok: bool, peer=None, peer_value=None) -> dict:
    """One row of the bench table."""
    return {"bench": "smach", "figure": figure, "value": round(value, 3), "unit": unit, "goal": goal, "peer": peer,
            "peer_value": peer_value and round(peer_value, 3), "ok": ok}  # fmt: skip


def wire_rows() -> list[dict]:
    """What arrives at a viewer, and what watching costs."""
    wire = introspection_figures()
    logged, log_alone, logged_extra = wire["logged"]
    where = f"{CONTAINERS} nested containers, {RUN_SECONDS:.0f} s"
    beats = f"heartbeats and structures that arrive, of {wire['beats_sent']:.0f}; {where}"
    moves = f"statuses at start, transition and end that arrive, of {wire['moves_sent']:.0f}; {where}"
    return [
        row(beats, wire["beats"], "%", ">= 100", wire["beats"] >= 100.0),
        row(moves, wire["moves"], "%", ">= 100", wire["moves"] >= 100.0),
        row("processor time of an idle machine with one viewer", wire["idle"], "% of a core", "<= 2",
            wire["idle"] <= 2.0),
        row("extra threads with one viewer", wire["extra"], "threads", "<= 4", wire["extra"] <= 4),
        row("a transition in a node, which logs it through rospy.loginfo", logged, "us", "<= peer + 50",
            logged_extra <= 50.0, "one rospy.loginfo", log_alone),
    ]  # fmt: skip


def main() -> None:
    if "--node" in sys.argv:
        node_main()
        return
    transition, bare = transition_cost()
    lost, left = preempt_campaign()
    rows = [
        *wire_rows(),
        row("a transition without a node, median of 30 runs of 1000", transition,
            "us", "<= 50", transition <= 50.0, "bare loop over the same states", bare),
        row(f"preempts lost, of {PREEMPTS} at random moments of nested concurrent machines", lost, "preempts", "<= 0",
            lost == 0),
        row(f"preempt flags left over after {PREEMPTS} preempts", left, "flags", "<= 0", left == 0),
    ]  # fmt: skip
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
