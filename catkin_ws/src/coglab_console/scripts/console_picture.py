#!/usr/bin/python3
"""Takes a picture of the console while the arm reaches for the mug. Starts its own simulated system.

Usage: ./coglab console picture [FILE]   (default: docs/images/console.png below the checkout). Exit status: 0 taken,
1 not taken, 2 wrong usage.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rospkg
from coglab_console.browser import Browser, fresh_link
from selenium.webdriver.common.by import By

LIMIT = 120.0  # s until the system is ready
ATTEMPTS = 3  # on a crowded computer the simulated controller may lose command mode
REACHES = "(s.dmp[0] === 'running' && s.dmp[2] < 0.3)"
STOPPED = "/[/](stopped|fault)$/.test(coglab.state().phase)"


def free_port() -> int:
    """Returns a free TCP port for the ROS master."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def take(home: Path, path: Path) -> None:
    """Opens the page, begins an exchange, and saves a picture in the middle of the reach."""
    with Browser() as browser:
        browser.open(fresh_link(home, limit=LIMIT), LIMIT)
        button = "[data-action=exchange_human_to_robot]"
        browser.until(f"return !document.querySelector('{button}').hasAttribute('aria-disabled')", LIMIT)
        browser.until("return document.querySelectorAll('#graph .node.active').length > 0", 30.0)
        time.sleep(12.0)  # charts fill
        browser.driver.find_element(By.CSS_SELECTOR, button).click()
        browser.js("document.activeElement.blur()")
        browser.until(f"const s = coglab.state(); return {REACHES} || {STOPPED}", 90.0)
        if browser.js(f"return {STOPPED}"):
            raise TimeoutError(f"the state machine stopped; {browser.summary()}")
        browser.picture(path)


def of_a_system(path: Path) -> None:
    """Starts a simulated system, takes the picture and ends the system. TimeoutError if no picture was taken."""
    with tempfile.TemporaryDirectory(prefix="coglab-picture-") as folder:
        port = free_port()
        environment = {
            **os.environ,
            "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
            "ROS_HOME": folder,
            "ROS_LOG_DIR": f"{folder}/log",
            "PYTHONUNBUFFERED": "1",
        }
        command = [
            "roslaunch",
            "-p",
            str(port),
            str(Path(rospkg.RosPack().get_path("coglab_bringup"), "launch", "coglab.launch")),
            "fri_period:=0.010",
            "console_port:=0",
        ]
        with Path(folder, "roslaunch.log").open("w") as log:
            system = subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)
            try:
                take(Path(folder), path)
            finally:
                system.send_signal(signal.SIGINT)
                system.wait(60)


def main(words: list[str]) -> int:
    """Entry point."""
    if words in (["-h"], ["--help"]):
        print(__doc__)
        return 0
    if len(words) > 1 or any(word.startswith("-") for word in words):
        print(__doc__, file=sys.stderr)
        return 2
    path = Path(words[0] if words else Path(os.environ["COGLAB_TOP"]) / "docs" / "images" / "console.png").absolute()
    for left in reversed(range(ATTEMPTS)):
        try:
            of_a_system(path)
            break
        except TimeoutError as error:
            print(f"[coglab] {'warning' if left else 'error'}: no picture: {error}", file=sys.stderr)
            if not left:
                return 1
    print(f"[coglab] wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
