"""Runs Debian's chromium without a screen, for tests, benchmarks and pictures of the console."""

from __future__ import annotations

import shutil
import socket
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

SIZE = (1280, 720)
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
    "--disable-component-update",
    "--disable-dev-shm-usage",
    "--hide-scrollbars=false",
    "--force-device-scale-factor=1",
)
SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
NO_GL = ("--disable-gpu", "--disable-3d-apis")


class Browser:
    """One browser with its own profile; `driver` is selenium's. Leaving the context closes it."""

    def __init__(self, webgl: bool = True, size: tuple[int, int] = SIZE, touch: bool = False) -> None:
        from selenium import webdriver

        options = webdriver.ChromeOptions()
        self._profile = tempfile.mkdtemp(prefix="coglab-browser-")
        for word in (*OPTIONS, *(SOFTWARE_GL if webgl else NO_GL), f"--user-data-dir={self._profile}"):
            options.add_argument(word)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        service = webdriver.chrome.service.Service("/usr/bin/chromedriver")
        self.driver = webdriver.Chrome(service=service, options=options)
        self.driver.set_script_timeout(60)
        # Without this, Tab after the last control gives the focus to the browser itself, and the page looks different.
        self.driver.execute_cdp_cmd("Emulation.setFocusEmulationEnabled", {"enabled": True})
        self._touch = touch
        self.resize(size)

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_error: object) -> None:
        try:
            self.driver.quit()
        finally:
            shutil.rmtree(self._profile, ignore_errors=True)

    def resize(self, size: tuple[int, int]) -> None:
        """Gives the page itself this width and height in pixels, without the window's frame."""
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": self._touch},
        )

    def open(self, link: str, limit: float = 30.0) -> None:
        """Opens the console at this one-time link. Returns when the page is live and shows the robot."""
        self.driver.get(link)
        if self._touch:  # now, as a page in a new process of Chromium may have lost it
            self.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 5})
        self.until(
            "return coglab.state() !== null && coglab.docs().desk !== undefined && coglab.view() !== 'none'", limit
        )

    def js(self, script: str, *arguments: Any) -> Any:
        """Runs a function body in the page and returns its value."""
        return self.driver.execute_script(script, *arguments)

    def until(self, script: str, limit: float, *arguments: Any) -> Any:
        """Waits until the script returns a true value. TimeoutError after `limit` s, with the text of the page."""
        end = time.monotonic() + limit
        while True:
            try:
                value = self.js(script, *arguments)
                if value:
                    return value
                problem = repr(value)
            except Exception as error:  # the page is not there yet
                problem = str(error).splitlines()[0]
            if time.monotonic() > end:
                raise TimeoutError(f"not within {limit:.0f} s: {script} ({problem}); {self.summary()}")
            time.sleep(0.1)

    def summary(self) -> str:
        """Text of the page, for a message."""
        try:
            return str(self.js("return document.body.innerText.slice(0, 600)"))
        except Exception as error:
            return str(error).splitlines()[0]

    def picture(self, path: Path) -> None:
        """Saves a screenshot."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.driver.save_screenshot(str(path))


def listens(link: str) -> bool:
    """True if the address of this link accepts connections."""
    place = urlsplit(link)
    try:
        with socket.create_connection((place.hostname or "", place.port or 0), timeout=2.0):
            return True
    except (OSError, ValueError):
        return False


def fresh_link(home: Path, used: str = "", limit: float = 30.0) -> str:
    """The link in console.url of this ROS_HOME, other than `used`.

    Waits until its console runs, because an earlier console may have left the file."""
    end = time.monotonic() + limit
    path = home / "console.url"
    while time.monotonic() < end:
        link = path.read_text().strip() if path.is_file() else ""
        if link and link != used and listens(link):
            return link
        time.sleep(0.1)
    raise TimeoutError(f"no new link in {path} within {limit:.0f} s; does the console run?")
