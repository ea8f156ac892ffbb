#!/usr/bin/python3
"""The console against the running cell: STOP from key-down to the bridge's hold, load, size, first paint,
whole actions by mouse and by keyboard, STOP in every phase, and what the console does to the FRI latency.
Every part has a cell and a process of its own; one that fails is a missed row that says why. Where the load of this
computer takes command mode from the simulated robot controller, what was under way is begun anew, twice at most, and
the row says how often.
Pictures: out/bench_console.

STOP: 200 presses, from the browser's key-down to the bridge's hold, both by this computer's clock; none left out. In
every phase: one STOP in each phase of each action, by the structure that the machine publishes, that a rehearsal of the
action has passed; one whose phase was not reached is missed. Before each the experimenter waits for the person's hand
to rest, and puts back an object that a STOP has let fall or that the hand has pushed.

Latency: the mean over 10 s with console and browser over that without, in pairs in random order; judged by the upper
end of the bootstrapped 95 % interval of the median.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
from coglab_bringup import process_tree
from coglab_console.browser import Browser, fresh_link
from console_cell import Cell, Operator, free_port
from console_load import FLOODED, flooded, load, resident
from console_page import page_rows, tab_rows, tablet_rows, tunnel_rows
from console_phases import on_the_way
from console_rows import row, say

PRESSES = 200
ACTIONS = ("exchange_human_to_robot", "put", "take", "exchange_robot_to_human")
"""put leaves the object on the board, take fetches it from there, give hands it back: the cell is as before"""
MOST_TAKEN = 40.0 + 120.0 / FLOODED
"""requests a second that one browser is allowed: the rate, and its share of those that may come at once"""
MOST_MEMORY = 20.0
"""MB by which the node may have grown after a flood: what waits is bounded"""
SETTLING, READINGS = 4, 10  # of the bridge's diagnostics, one a second: left out, and taken, of each block


# --- STOP -----------------------------------------------------------------------------------------------------


def stop_latencies(cell: Cell, operator: Operator) -> list[float]:
    """ms from the key's way down, in the browser's clock, to the hold, in the bridge's; both are this computer's."""
    browser, found = operator.browser, []
    browser.js(
        "window.addEventListener('keydown', (e) => { window.pressedAt = performance.timeOrigin + e.timeStamp; }, true)"
    )
    chance = random.Random(1)
    for _ in range(PRESSES):
        # a person's own rhythm, not the cycle's
        time.sleep(chance.uniform(0.05, 0.15))
        since, cell.held_at = operator.newest_event(), 0.0
        operator.stop()
        cell.wait(lambda: cell.held_at > 0.0, 3.0, "the hold")
        found.append(1000 * cell.held_at - browser.js("return window.pressedAt"))
        operator.answered(since)
        cell.reset_arm()
    return sorted(found)


def stop_rows(cell: Cell, operator: Operator) -> list[dict]:
    found = stop_latencies(cell, operator)
    operator.go_on()
    median, high = statistics.median(found), found[int(0.99 * (len(found) - 1))]
    return [
        row("STOP, key-down to the bridge's hold, median of 200", round(median, 2), "ms", "<= 30", median <= 30.0),
        row("STOP, key-down to the bridge's hold, p99 of 200", round(high, 2), "ms", "<= 100", high <= 100.0),
    ]


def stop_in(cell: Cell, operator: Operator, action: str, state: str) -> tuple[bool, bool]:
    """Whether this phase of the action was reached, and whether STOP held the arm in it."""
    reached = stopped = False
    try:
        operator.bring_to(action)
        cell.passed.clear()
        operator.press(action, keyboard=False)
        cell.wait(lambda: cell.came_to(state), 45.0, state)
        reached = True
        operator.stop()
        cell.wait(lambda: cell.arm.hold_latched, 1.0, "the hold")
        stopped = True
        operator.go_on()
    except TimeoutError as error:
        say(f"{action}, {state}: {error}")
    return reached, stopped


def rehearsed(cell: Cell, operator: Operator) -> tuple[list[tuple[str, str]], list[str], int]:
    """Each action once: (action, state) of the phases that it has passed, the other ones of the machine's structure,
    and how many actions came to their end."""
    places: list[tuple[str, str]] = []
    aside: list[str] = []
    done = 0
    for action in ACTIONS:
        cell.passed.clear()
        done += operator.carry_out(action, False, f"rehearsal_{action}")
        phases, recovery = cell.phases(action)
        way, rest = on_the_way(phases, list(cell.passed))
        places += [(action, state) for state in way]
        aside += [*rest, *recovery]
        operator.recover()
    return places, aside, done


def phase_rows(cell: Cell, operator: Operator) -> list[dict]:
    """STOP in every phase of the machine's own structure that an action nobody disturbs passes."""
    places, aside, done = rehearsed(cell, operator)
    for state in aside:
        say(f"not on the way of an action that nobody disturbs: {state}")
    reached, stopped = 0, 0
    for action, state in places:
        found = operator.unless_crowded(
            lambda place=(action, state): stop_in(cell, operator, *place), lambda both: both[0]
        )
        reached += found[0]
        stopped += found[1]
        operator.recover()
    figure = f"STOP in every phase ({reached} of {len(places)} reached){operator.crowded()}"
    every = stopped == len(places) and done == len(ACTIONS)
    return [
        row(figure, stopped, "stops", f"{len(places)}", every),
        row("phases of the machine that only an incident brings about", len(aside), "phases", "told", True),
    ]


# --- actions --------------------------------------------------------------------------------------------------


def action_rows(cell: Cell, operator: Operator) -> list[dict]:
    """Each action from hub to hub by mouse, then by keyboard; the hand in the picture against tf after each."""
    rows, far = [], []
    for keyboard in (False, True):
        way, good = "keyboard" if keyboard else "mouse", 0
        for action in ACTIONS:
            good += operator.carry_out(action, keyboard, f"{way}_{action}")
            try:
                far.append(operator.distance_to_tf())
            except TimeoutError as error:
                say(f"after {action} by {way}: {error}")
            operator.recover()
        figure = f"exchange both ways, take and put by {way}{operator.crowded()}"
        rows.append(row(figure, good, "actions", "4 of 4", good == 4))
    away = max(far, default=None)
    far_row = row(
        f"hand in the 3D picture to tf, largest after {len(far)} actions",
        away and round(1000 * away, 3),
        "mm",
        "<= 2",
        away is not None and away <= 0.002,
    )
    return [*rows, far_row]


# --- load -----------------------------------------------------------------------------------------------------


def load_rows(cell: Cell, _pictures: Path) -> list[dict]:
    uri = rosgraph.Master("/console_bench").lookupNode("/coglab_console")
    process = ServerProxy(uri).getPid("/console_bench")[2]
    share, rate = asyncio.run(load(cell.home, process))
    return [
        row("node with 5 browsers, robot at rest", round(100 * share, 1), "% of a core", "<= 25", share <= 0.25),
        row("state to the slowest of 5 browsers", round(rate, 1), "Hz", ">= 28", rate >= 28.0),
        *flood_rows(cell, process),
    ]


def robot_hurt(cell: Cell) -> int:
    """How often a datagram between robot and bridge was lost, or command mode ended, since the cell began."""
    counted = ("measurements lost", "answers lost", "restarts of the controller")
    return sum(int(cell.fri[name]) for name in counted) + cell.supervisors.count("stopped")


def flood_rows(cell: Cell, process: int) -> list[dict]:
    """One browser asks 1000 times a second beside one that never reads: the robot goes on as before, another browser
    and STOP are served, and what is taken and kept is bounded."""
    first = len(cell.answers)
    cell.wait(lambda: len(cell.answers) > first, 5.0, "the bridge's diagnostics")
    hurt = robot_hurt(cell)
    last = len(cell.answers) + round(FLOODED)
    cell.wait(lambda: len(cell.answers) >= last, 2.0 * FLOODED, "the bridge's diagnostics")
    calm = robot_hurt(cell) - hurt
    before, hurt = resident(process), robot_hurt(cell)
    sent, taken, states, stop = asyncio.run(flooded(cell.home))
    cell.wait(lambda: cell.arm.hold_latched, 3.0, "the hold")
    last = len(cell.answers)
    cell.wait(lambda: len(cell.answers) > last, 5.0, "the bridge's diagnostics")
    grown, hurt = resident(process) - before, robot_hurt(cell) - hurt
    cell.reset_arm()
    beside = "beside a browser that never reads and 1000 requests/s"
    return [
        row("requests by one browser, answered", round(sent, 1), "Hz", ">= 990", sent >= 990.0),
        row(
            "requests by one browser, taken, of 1000 asked per second",
            round(taken, 1),
            "Hz",
            f"<= {MOST_TAKEN:.0f}",
            taken <= MOST_TAKEN,
        ),
        row(
            f"robot: datagrams lost, ends of command mode, {beside}",
            hurt,
            "times",
            "<= peer",
            hurt <= calm,
            "the same time before",
            calm,
        ),
        row(
            f"memory that the node gained {beside}",
            round(grown, 1),
            "MB",
            f"<= {MOST_MEMORY:.0f}",
            grown <= MOST_MEMORY,
        ),
        row(f"state to another browser {beside}", round(states, 1), "Hz", ">= 28", states >= 28.0),
        row(f"longest STOP to its answer {beside}", round(1000 * stop, 1), "ms", "<= 100", stop <= 0.1),
    ]


# --- what the console does to the robot's loop ----------------------------------------------------------------


def block(cell: Cell) -> dict[str, float]:
    """Means of READINGS from now on, after SETTLING that are left out."""
    first = len(cell.answers) + SETTLING
    last = first + READINGS
    cell.wait(lambda: len(cell.answers) >= last, 5.0 * (SETTLING + READINGS), "the bridge's diagnostics")
    return {
        "FRI latency": statistics.fmean(cell.latencies[first:last]),
        "answer time": statistics.fmean(cell.answers[first:last]),
    }


def latency_rows(pairs: int) -> list[dict]:
    """Pairs of blocks with and without console and browser, the order by chance; bootstrap over the pairs."""
    cell = Cell(console=False)
    ratios: dict[str, list[float]] = {"FRI latency": [], "answer time": []}
    try:
        cell.connect()
        chance = random.Random(2)
        for number in range(pairs):
            means: dict[bool, dict[str, float]] = {}
            for with_console in chance.sample([True, False], 2):
                browser = None
                if with_console:
                    cell.launch_console()
                    browser = Browser()
                    browser.open(fresh_link(cell.home, limit=60.0), 60.0)
                means[with_console] = block(cell)
                if browser is not None:
                    browser.__exit__()
                    cell.end_console()
            for name, found in ratios.items():
                found.append(means[True][name] / means[False][name])
            say(
                f"pair {number + 1} of {pairs}: "
                + ", ".join(f"{name} x {found[-1]:.3f}" for name, found in ratios.items())
            )
    finally:
        cell.close()
    rows = []
    for name, found in ratios.items():
        means = sorted(statistics.median(chance.choices(found, k=len(found))) for _ in range(4000))
        high = means[int(0.975 * len(means))]
        goal = name == "FRI latency"
        rows.append(
            row(
                f"{name} with console and browser over without, upper end of 95 %",
                round(high, 3),
                "ratio",
                "<= 1.05" if goal else "told",
                high <= 1.05 or not goal,
                "median of pairs",
                round(statistics.median(found), 3),
            )
        )
    return rows


# --- parts ----------------------------------------------------------------------------------------------------


def with_cell(work: Callable[[Cell, Path], list[dict]]) -> Callable[[Path], list[dict]]:
    """A part that needs a running cell with its console."""

    def part(pictures: Path) -> list[dict]:
        cell = Cell(console=True)
        try:
            cell.connect()
            return work(cell, pictures)
        finally:
            cell.close()

    return part


def with_operator(work: Callable[[Cell, Operator], list[dict]]) -> Callable[[Path], list[dict]]:
    """A part that needs a browser that operates, too."""

    def part(cell: Cell, pictures: Path) -> list[dict]:
        with Browser() as browser:
            browser.open(fresh_link(cell.home), 60.0)
            operator = Operator(browser, cell, pictures)
            operator.take_control()
            return work(cell, operator)

    return with_cell(part)


PARTS: dict[str, tuple[float, Callable[[Path], list[dict]]]] = {  # s that it may take, and the work
    "page": (240.0, with_cell(page_rows)),
    "load": (240.0, with_cell(load_rows)),
    "tabs": (400.0, with_cell(tab_rows)),
    "tablet": (400.0, with_cell(tablet_rows)),
    "tunnel": (300.0, lambda pictures: tunnel_rows(pictures, free_port())),
    "stop": (900.0, with_operator(stop_rows)),
    "actions": (900.0, with_operator(action_rows)),
    "phases": (3600.0, with_operator(phase_rows)),
    "latency": (3600.0, lambda _: latency_rows(20 if os.environ.get("COGLAB_LONG") else 8)),
}


def missed(part: str, why: str) -> dict:
    """The row of a part that gave no figures."""
    return row(f"{part}: did not run: {why}", None, "", "runs", False)


def in_own_process(part: str, limit: float) -> list[dict]:
    """The rows of a part; nothing that it started outlives it. (A node belongs to one ROS master.)"""
    with tempfile.TemporaryFile("w+") as output:
        environment = {**os.environ, "CONSOLE_BENCH_PART": part}
        status = process_tree.run([sys.executable, __file__], limit, stdout=output, env=environment)
        if status is None:
            return [missed(part, f"no end within {limit:.0f} s")]
        output.seek(0)
        try:
            return json.loads(output.read())
        except ValueError:
            return [missed(part, f"exit status {status}")]


def rows_of(part: str, pictures: Path) -> list[dict]:
    """The part in this process; what it raises is its row."""
    try:
        return PARTS[part][1](pictures)
    except Exception as error:
        return [missed(part, f"{type(error).__name__}: {' '.join(str(error).split())[:400]}")]


def end(number: int, _frame: object) -> None:
    """Unwinds, so that what was started ends, also where a shell has SIGINT ignored."""
    sys.exit(f"ended by {signal.Signals(number).name}")


def main() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    own = os.environ.get("CONSOLE_BENCH_PART")
    if own:
        print(json.dumps(rows_of(own, Path(os.environ.get("COGLAB_TOP", ".")) / "out" / "bench_console")))
        return
    rows: list[dict] = []
    for part in os.environ.get("CONSOLE_BENCH_PARTS", " ".join(PARTS)).split():
        say(part)
        found = in_own_process(part, PARTS[part][0]) if part in PARTS else [missed(part, f"parts: {', '.join(PARTS)}")]
        for one in found:
            verdict = "ok" if one["ok"] else "MISSED"
            say(f"{verdict}: {one['figure']}: {one['value']} {one['unit']} (goal {one['goal']})")
        rows += found
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
