#!/usr/bin/python3
"""The console against the running cell: STOP from key-down to the bridge's hold, load, size, first paint,
whole actions by mouse and by keyboard, STOP in every phase, and what the console does to the FRI latency.
Pictures: out/bench_console."""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
from coglab_console.browser import Browser, fresh_link
from console_cell import Cell, Operator
from console_load import flooded, load

PRESSES = 200
PHASES = {  # action: labels in which STOP is pressed
    "exchange_human_to_robot": ("set_dmp_goal", "execute_dmp", "wait_stop", "hand_close", "coglab_home_robot"),
    "exchange_robot_to_human": ("set_dmp_goal", "execute_dmp", "wait_stop", "hand_open", "coglab_home_robot"),
}
BLOCK = 10.0  # s, with or without the console


def row(
    figure: str,
    value: float | None,
    unit: str,
    goal: str,
    ok: bool,
    peer: str | None = None,
    peer_value: float | None = None,
) -> dict:
    """A row as coglab_bringup.bench reads it."""
    return dict(
        bench="console", figure=figure, value=value, unit=unit, goal=goal, peer=peer, peer_value=peer_value, ok=ok
    )


def say(text: str) -> None:
    """Progress, for people."""
    print(f"[console bench] {text}", file=sys.stderr, flush=True)


# --- STOP -----------------------------------------------------------------------------------------------------


def stop_latencies(cell: Cell, operator: Operator) -> list[float]:
    """ms from the key's way down, in the browser's clock, to the hold, in the bridge's; both are this computer's."""
    browser, found = operator.browser, []
    browser.js(
        "window.addEventListener('keydown', (e) => { window.pressedAt = performance.timeOrigin + e.timeStamp; }, true)"
    )
    chance = random.Random(1)
    for _ in range(PRESSES):
        time.sleep(chance.uniform(0.05, 0.15))
        cell.held_at = 0.0
        operator.stop()
        cell.wait(lambda: cell.held_at > 0.0, 3.0, "the hold")
        found.append(1000 * cell.held_at - browser.js("return window.pressedAt"))
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


def phase_rows(cell: Cell, operator: Operator) -> list[dict]:
    """STOP in every phase of an exchange each way; both ends of the way back, too."""
    reached, stopped = 0, 0
    wanted = sum(len(labels) for labels in PHASES.values())
    for action, labels in PHASES.items():
        for label in labels:
            try:
                bring_to(cell, operator, action)
                operator.press(action, keyboard=False)
                cell.wait(
                    lambda label=label, action=action: cell.leaf == label and action in cell.machine.state, 45.0, label
                )
                reached += 1
                operator.stop()
                cell.wait(lambda: cell.arm.hold_latched, 1.0, "the hold")
                stopped += 1
                operator.go_on()
            except TimeoutError as error:
                say(f"{action}, {label}: {error}")
                if cell.leaf in ("stopped", "fault"):
                    operator.stop()
                    operator.go_on()
                cell.wait(lambda: cell.machine.in_hub, 90.0, "the hub")
    return [
        row(f"STOP in every phase ({reached} of {wanted} reached)", stopped, "stops", f"{wanted}", stopped == wanted)
    ]


def bring_to(cell: Cell, operator: Operator, action: str) -> None:
    """The hub that offers this action."""
    other = {
        "exchange_human_to_robot": "exchange_robot_to_human",
        "exchange_robot_to_human": "exchange_human_to_robot",
    }[action]
    for _ in range(3):
        cell.wait(lambda: cell.machine.in_hub, 60.0, "the hub")
        if action in cell.machine.actions:
            return
        operator.do(other, False, "between")
    raise TimeoutError(f"{action} was not offered")


# --- actions --------------------------------------------------------------------------------------------------


def action_rows(cell: Cell, operator: Operator) -> list[dict]:
    rows = []
    for keyboard in (False, True):
        way, good = "keyboard" if keyboard else "mouse", 0
        # put leaves the object on the board, take fetches it from there, give hands it back: the cell is as before
        for action in ("exchange_human_to_robot", "put", "take", "exchange_robot_to_human"):
            try:
                good += operator.do(action, keyboard, f"{way}_{action}")
            except TimeoutError as error:
                say(f"{action} by {way}: {error}")
        rows.append(row(f"exchange both ways, take and put by {way}", good, "actions", "4 of 4", good == 4))
    return rows


# --- load -----------------------------------------------------------------------------------------------------


def load_rows(cell: Cell) -> list[dict]:
    uri = rosgraph.Master("/console_bench").lookupNode("/coglab_console")
    process = ServerProxy(uri).getPid("/console_bench")[2]
    share, rate = asyncio.run(load(cell.home, process))
    sent, refused, states, stop = asyncio.run(flooded(cell.home))
    cell.wait(lambda: cell.arm.hold_latched, 3.0, "the hold")
    cell.reset_arm()
    beside = f"beside a browser that never reads and {sent:.0f} requests/s"
    return [
        row("node with 5 browsers", round(100 * share, 1), "% of a core", "<= 25", share <= 0.25),
        row("state to the slowest of 5 browsers", round(rate, 1), "Hz", ">= 28", rate >= 28.0),
        row(f"refused of {sent:.0f} requests a second by one browser", round(100 * refused, 1), "%", "told", True),
        row(f"state to another browser {beside}", round(states, 1), "Hz", ">= 28", states >= 28.0),
        row(f"longest STOP to its answer {beside}", round(1000 * stop, 1), "ms", "<= 100", stop <= 0.1),
    ]


def page_rows(cell: Cell) -> list[dict]:
    """Size as it goes over the wire, and first paint of five loads with an empty cache."""
    paints, sizes = [], []
    for _ in range(5):
        with Browser() as browser:
            browser.open(fresh_link(cell.home))
            time.sleep(2.0)
            paints.append(browser.js("return performance.getEntriesByName('first-contentful-paint')[0].startTime"))
            sizes.append(
                browser.js(
                    "return ['resource', 'navigation'].flatMap((kind) => performance.getEntriesByType(kind))"
                    ".reduce((sum, one) => sum + one.encodedBodySize, 0)"
                )
            )
    paint, size = statistics.median(paints) / 1000, max(sizes) / 1e6
    return [
        row("first paint, median of 5 loads", round(paint, 3), "s", "<= 1", paint <= 1.0),
        row("page and libraries, compressed", round(size, 3), "MB", "<= 1", size <= 1.0),
    ]


# --- what the console does to the robot's loop ----------------------------------------------------------------


def mean_of(rows: list[tuple[float, float]], since: float) -> float:
    """Mean of the values noted after `since`."""
    return statistics.fmean(value for stamp, value in rows if stamp > since)


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
                time.sleep(4.0)
                since = time.monotonic()
                time.sleep(BLOCK)
                means[with_console] = {
                    "FRI latency": mean_of(cell.latencies, since),
                    "answer time": mean_of(cell.answers, since),
                }
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


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended by SIGTERM"))  # the cell ends with us
    pictures = Path(os.environ.get("COGLAB_TOP", ".")) / "out" / "bench_console"
    rows: list[dict] = []
    parts = os.environ.get("CONSOLE_BENCH_PARTS", "page load stop actions phases latency").split()
    if set(parts) - {"latency"}:
        cell = Cell(console=True)
        try:
            cell.connect()
            if "page" in parts:
                rows += page_rows(cell)
            if "load" in parts:
                rows += load_rows(cell)
            if set(parts) & {"stop", "actions", "phases"}:
                with Browser() as browser:
                    browser.open(fresh_link(cell.home), 60.0)
                    operator = Operator(browser, cell, pictures)
                    take_control(browser)
                    for part, work in (("stop", stop_rows), ("actions", action_rows), ("phases", phase_rows)):
                        if part in parts:
                            say(part)
                            rows += work(cell, operator)
        finally:
            cell.close()
    if "latency" in parts:
        if parts == ["latency"]:
            rows += latency_rows(20 if os.environ.get("COGLAB_LONG") else 8)
        else:  # a node belongs to one ROS master: the second cell gets a process of its own
            environment = {**os.environ, "CONSOLE_BENCH_PARTS": "latency"}
            done = subprocess.run([sys.executable, __file__], env=environment, stdout=subprocess.PIPE, check=True)
            rows += json.loads(done.stdout)
    print(json.dumps(rows))


def take_control(browser: Browser) -> None:
    """The browsers that measured before may hold the control; they are gone."""
    operating = "return document.getElementById('role').innerText.startsWith('you operate')"
    if not browser.js(operating):
        browser.js("document.querySelector('#control button').click()")
    browser.until(operating, 15.0)


if __name__ == "__main__":
    main()
