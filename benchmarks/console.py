#!/usr/bin/python3
"""The experimenter's page with the running cell: time from the key press of STOP in the browser to the bridge's hold,
both by this computer's clock, and first paint with an empty cache."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import rosgraph
import rospy
from coglab_bringup.run_directory import free_port, run_environment
from coglab_console.browser import Browser, fresh_link
from coglab_msgs.msg import LwrState, MasterState
from coglab_msgs.srv import LwrCommand
from common import Row, end, main, median, quantile
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

READY = 120.0  # s, longest wait for the hub
REQUEST_LIMIT = 9.0  # s, time limit of the page's requests
OPERATING = "return document.getElementById('role').innerText.startsWith('you operate')"
LOADED = (
    "return coglab.view() === '3D' && document.querySelectorAll('#charts canvas').length >= 5"
    " && performance.getEntriesByName('first-contentful-paint').length > 0"
)
# The page sends each press by its connection and by a request. The console sends each of them to the arm and the brain.
ANSWERED = """
const rows = coglab.events().filter((e) => e.seq > arguments[0] && e.source === 'stop').map((e) => e.text);
const answers = rows.filter((text) => text.startsWith('STOP, ') || text.includes('cannot be reached')).length;
const presses = rows.filter((text) => text.startsWith('STOP by')).length;
return presses === arguments[1] && answers === 2 * presses && presses;
"""


class Cell:
    """The launched system with its console. It ends with the stack."""

    def __init__(self, stack: ExitStack) -> None:
        self.home = Path(stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        port = free_port()
        os.environ.update(run_environment(port, self.home))
        words = ["fri_period:=0.010", "console_port:=0"]
        launch = ["roslaunch", "-p", str(port), "coglab_bringup", "coglab.launch", *words]
        stack.callback(end, subprocess.Popen(launch, stdout=sys.stderr), 60.0)
        self.machine, self.arm, self.held_at = MasterState(), LwrState(), 0.0
        self.wait(rosgraph.is_master_online, READY, "the ROS master")
        rospy.init_node("bench_console", disable_signals=True)
        rospy.Subscriber("/coglab/state", MasterState, lambda message: setattr(self, "machine", message))
        rospy.Subscriber("/lwr/state", LwrState, self._on_arm, tcp_nodelay=True)
        self.wait(lambda: self.machine.in_hub and "wait" in self.machine.state, READY, "the hub")

    def _on_arm(self, message: LwrState) -> None:
        if message.hold_latched and not self.arm.hold_latched:
            self.held_at = message.header.stamp.to_sec()
        self.arm = message

    def wait(self, ready: Callable[[], bool], limit: float, what: str) -> None:
        """Waits until ready(). TimeoutError after `limit` s."""
        last = time.monotonic() + limit
        while not ready():
            if time.monotonic() > last:
                raise TimeoutError(
                    f"{what} did not come within {limit:.0f} s: {self.machine.state}, {self.machine.why}"
                )
            time.sleep(0.01)


def first_paint(cell: Cell, loads: int) -> list[float]:
    """First paint (s) in each of `loads` new browsers."""
    found = []
    for _ in range(loads):
        with Browser() as browser:
            browser.open(fresh_link(cell.home, limit=60.0))
            browser.until(LOADED, 20.0)
            paint = "return performance.getEntriesByName('first-contentful-paint')[0].startTime"
            found.append(browser.js(paint) / 1000.0)
    return found


def stop_latencies(cell: Cell, presses: int) -> list[float]:
    """Times (ms) from the key press to the hold."""
    chance, found = random.Random(1), []
    with Browser() as browser:
        browser.open(fresh_link(cell.home, limit=60.0), 60.0)
        if not browser.js(OPERATING):
            browser.js("document.querySelector('#control button').click()")
        browser.until(OPERATING, 15.0)
        pressed = "(e) => { window.pressedAt = performance.timeOrigin + e.timeStamp; }"
        browser.js(f"window.addEventListener('keydown', {pressed}, true)")
        for _ in range(presses):
            time.sleep(chance.uniform(0.05, 0.15))  # random, not synchronous with the control cycle
            since, cell.held_at = browser.js("return coglab.events().at(-1)?.seq ?? 0"), 0.0
            ActionChains(browser.driver).send_keys(Keys.SPACE).perform()
            cell.wait(lambda: cell.held_at > 0.0, 3.0, "the hold")
            found.append(1000.0 * cell.held_at - browser.js("return window.pressedAt"))
            try:
                browser.until(ANSWERED, REQUEST_LIMIT + 6.0, since, 2)
            except TimeoutError:
                browser.until(ANSWERED, 1.0, since, 1)  # the page was reconnecting: only the request arrived
            rospy.ServiceProxy("/lwr/command", LwrCommand)("reset")
            cell.wait(lambda: not cell.arm.hold_latched, 10.0, "the end of the hold")
    return found


def page(quick: bool) -> Iterator[Row]:
    """First paint and STOP."""
    with ExitStack() as stack:
        cell = Cell(stack)
        paints = first_paint(cell, 2 if quick else 5)
        stops = stop_latencies(cell, 5 if quick else 200)
    yield median("first paint of the console", paints, "s", "<= 1")
    yield median("STOP in the browser to the arm's hold", stops, "ms", "<= 30")
    yield quantile("STOP in the browser to the arm's hold, 99th percentile", stops, 0.99, "ms", "<= 100")


if __name__ == "__main__":
    main("console", page)
