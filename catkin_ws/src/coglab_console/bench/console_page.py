"""The page itself: first paint, size, every tab looked at, a tablet, and a tunnel from another port."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

from coglab_console.browser import Browser, fresh_link
from coglab_console.forwarder import Forwarder
from coglab_console.page_check import PAGES, focus_order, look
from console_cell import Cell, Operator
from console_rows import row, say

PAINTS = 5
TABLET = (1024, 768)
LOADED = (
    "return coglab.view() === '3D' && document.querySelectorAll('#charts canvas').length >= 5"
    " && performance.getEntriesByName('first-contentful-paint').length > 0"
)
FILLED = {  # what a page has when all of it is there
    "Live": ("#charts .last canvas",),
    "Machine": ("#graph .node.active",),
    "Experiment": ("#page form",),
    "Contact": ("#page .bar",),
    "Objects": ("#object-problems li", "#page td"),
    "Primitives": ("#page canvas",),
    "Feedback": ("#feedback-profile",),
    "Events": ("#page li",),
    "Health": ("#diagnostics summary", "#parameters td"),
    "Help": ("#page td",),
}


def page_rows(cell: Cell, _pictures: Path) -> list[dict]:
    """Size as it goes over the wire, and first paint of five loads with an empty cache."""
    paints, sizes = [], []
    for _ in range(PAINTS):
        with Browser() as browser:
            browser.open(fresh_link(cell.home))
            browser.until(LOADED, 20.0)
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


def filled(browser: Browser, page: str) -> None:
    """Waits until this page of the console is there with all that belongs to it."""
    browser.until("return document.getElementById('tab-' + arguments[0]).ariaSelected === 'true'", 5.0, page)
    for selector in FILLED[page]:
        browser.until("return document.querySelector(arguments[0]) !== null", 20.0, selector)
    browser.painted()


def tab_rows(cell: Cell, pictures: Path) -> list[dict]:
    """Every tab at 1280x720, with and without WebGL on the first; the hand in the picture against tf."""
    looked: dict[str, list[str]] = {}
    reached = 0
    orders: dict[str, list[str]] = {}
    with Browser() as browser:
        browser.open(fresh_link(cell.home), 60.0)
        for page in PAGES:
            browser.tab(page)
            filled(browser, page)
            looked[page], _ = look(browser)
            browser.picture(pictures / f"tab_{page.lower()}.png")
            names, orders[page] = focus_order(browser)
            reached += len(names)
        browser.tab("Live")
        far = {browser.js("return coglab.view()"): Operator(browser, cell, pictures).distance_to_tf()}
    with Browser(webgl=False) as browser:
        browser.open(fresh_link(cell.home), 60.0)
        filled(browser, "Live")
        looked["Live without WebGL"], _ = look(browser)
        browser.picture(pictures / "tab_live_2d.png")
        far[browser.js("return coglab.view()")] = Operator(browser, cell, pictures).distance_to_tf()
    for kind, found in (("look", looked), ("focus", orders)):
        for page, problems in found.items():
            for problem in problems:
                say(f"{kind}, {page}: {problem}")
    bad, lost = sum(map(len, looked.values())), sum(map(len, orders.values()))
    rows = [
        row("tabs: scroll bar, STOP, names, sizes, contrast at 1280x720", bad, "problems", "0", bad == 0),
        row(f"focus order on {len(PAGES)} tabs, {reached} stations", lost, "problems", "0", lost == 0),
    ]
    for view in ("3D", "2D"):
        away = far.get(view)
        good = away is not None and away <= 0.002
        rows.append(row(f"hand in the {view} picture to tf", away and round(1000 * away, 3), "mm", "<= 2", good))
    return rows


def stops_by(cell: Cell, press: Callable[[], None]) -> float:
    """s from a press to the hold as this process sees it; the arm is free again afterwards."""
    began = time.monotonic()
    press()
    cell.wait(lambda: cell.arm.hold_latched, 5.0, "the hold")
    return time.monotonic() - began


def tunnel_rows(pictures: Path, free_port: int) -> list[dict]:
    """From another port, named in console_hosts, as docs/console.md says: an exchange, STOP to the hold."""
    cell = Cell(console=True, hosts=f"127.0.0.1:{free_port}")
    try:
        cell.connect()
        link = fresh_link(cell.home, limit=60.0)
        port = int(link.split("/?")[0].rsplit(":", 1)[1])
        tunnel = Forwarder(port, free_port)
        with Browser() as browser:
            browser.open(link.replace(f":{port}/", f":{free_port}/"), 60.0)
            operator = Operator(browser, cell, pictures)
            operator.take_control()
            done = operator.carry_out("exchange_human_to_robot", False, "tunnel_receive")
            took = stops_by(cell, operator.stop)
            operator.go_on()
            browser.picture(pictures / "tunnel.png")
            again = operator.crowded()
        tunnel.close()
    finally:
        cell.close()
    return [
        row(f"through a tunnel from another port: receive, then STOP{again}", int(done), "actions", "1", done),
        row("through a tunnel: STOP to the hold as seen", round(1000 * took, 1), "ms", "told", True),
    ]


def tablet_rows(cell: Cell, pictures: Path) -> list[dict]:
    """1024x768 by touch alone: an exchange, STOP, the two acts after it."""
    with Browser(size=TABLET, touch=True) as browser:
        browser.open(fresh_link(cell.home), 60.0)
        operator = Operator(browser, cell, pictures)
        problems: list[str] = []
        for page in PAGES:
            browser.touch(f"#tab-{page}")
            filled(browser, page)
            found, _ = look(browser)
            problems += [f"{page}: {one}" for one in found]
            browser.picture(pictures / f"tablet_{page.lower()}.png")
        browser.touch("#tab-Live")
        for problem in problems:
            say(f"tablet, {problem}")
        operator.touches = True
        operator.take_control()
        done = operator.carry_out("exchange_human_to_robot", False, "tablet_receive")
        stops_by(cell, lambda: browser.touch("#stop"))
        browser.picture(pictures / "tablet_stopped.png")
        operator.go_on()
        figure = f"tablet, 1024x768 by touch: receive, STOP, acknowledge, hold{operator.crowded()}"
    return [
        row(figure, int(done), "actions", "1", done),
        row("tablet: STOP, names, sizes, contrast on every tab", len(problems), "problems", "0", not problems),
    ]
