"""Browser of the console's tests: opens tabs, touches and holds controls, and reads the console of the page."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from coglab_console.browser import Browser

HOLD_AGAIN = 5.0  # s after which a held button is released and pressed again


class PageBrowser(Browser):
    """A browser with the actions of a person on the page."""

    def painted(self) -> None:
        """Waits until the page was drawn twice, so that earlier changes are visible."""
        self.driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")

    def tab(self, name: str) -> None:
        """Opens a tab of the console."""
        self.js("document.getElementById('tab-' + arguments[0]).click()", name)

    def touch(self, selector: str, done: Callable[[], bool] = lambda: True, limit: float = 5.0) -> None:
        """Puts a finger on the middle of an element until `done()`, as on a tablet. TimeoutError after `limit` s."""
        x, y = self.js(
            "const e = document.querySelector(arguments[0]); e.scrollIntoView({ block: 'nearest', inline: 'nearest' });"
            "const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]",
            selector,
        )
        send = self.driver.execute_cdp_cmd
        send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        end = time.monotonic() + limit
        try:
            while not done():
                if time.monotonic() > end:
                    raise TimeoutError(f"touching {selector} did nothing within {limit:.0f} s; {self.summary()}")
                time.sleep(0.05)
        finally:
            send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def complaints(self) -> list[str]:
        """Warnings and errors of the page's console since the last call."""
        return [row["message"] for row in self.driver.get_log("browser") if row["level"] in ("SEVERE", "WARNING")]


def acknowledge(browser: PageBrowser, press: Callable[[], None], limit: float = 20.0) -> None:
    """Acknowledges the newest stop, again if another one came in between. TimeoutError after `limit` s."""
    end = time.monotonic() + limit
    while browser.js("return coglab.docs().desk.guard.unacknowledged"):
        browser.until("return document.getElementById('acknowledge').offsetParent !== null", limit)
        press()
        try:
            browser.until("return !coglab.docs().desk.guard.unacknowledged", 2.0)
        except TimeoutError:
            if time.monotonic() > end:
                raise


def press_and_hold(browser: PageBrowser, element: Any, done: Callable[[], bool], limit: float = 5.0) -> None:
    """Holds a button with the mouse until `done()`. TimeoutError after `limit` s.

    Lets go and presses again every HOLD_AGAIN s: on a busy computer the page may move the button away from the mouse,
    or refuse the command for a moment, and each of them ends the holding."""
    # Here, because tests without a browser import this file too.
    from selenium.webdriver.common.action_chains import ActionChains

    end = time.monotonic() + limit
    while True:
        ActionChains(browser.driver).move_to_element(element).click_and_hold().perform()
        again = time.monotonic() + HOLD_AGAIN
        try:
            while time.monotonic() < min(again, end):
                if done():
                    return
                time.sleep(0.05)
        finally:
            ActionChains(browser.driver).release().perform()
        if time.monotonic() >= end:
            raise TimeoutError(f"holding the button did nothing within {limit:.0f} s; {browser.summary()}")
        print(f"REPEATED holding a button: nothing within {HOLD_AGAIN:.0f} s", flush=True)  # ./coglab test lists it
