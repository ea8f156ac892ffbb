"""The page in a real browser with a double in place of the robot, for tests of the page."""

import asyncio
import shutil
import threading
import time

import pytest
from console_double import PAGE_DOCUMENTS, RobotDouble, page_state, running
from page_browser import PageBrowser

needs_browser = pytest.mark.skipif(
    shutil.which("chromedriver") is None, reason="chromium-driver is missing: ./coglab install browser"
)

# Puts the page's connections in a test's hand: deaf ones say nothing and stay open, as behind a cable that was pulled;
# `slow` is what each message costs, as on a computer that is busy.
IN_HAND = """
window.connections = []; window.slow = 0;
const Real = WebSocket;
window.WebSocket = class extends Real {
  constructor(address) { super(address); this.opened = performance.now(); window.connections.push(this); }
  set onmessage(f) { super.onmessage = (event) => {
    if (this.deaf) return;
    const end = performance.now() + window.slow;
    while (performance.now() < end);
    f(event);
  }; }
  set onclose(f) { super.onclose = (event) => this.deaf || f(event); }
  send(data) { if (!this.deaf) super.send(data); }
};
"""

STATUS: dict = {
    "machine": {"alive": True, "state": "/m/wait_without_object", "words": "ready", "hub": True, "actions": ["take"],
                "object": "", "why": "", "fallback": "mug"},
    "arm": {"alive": True, "supervisor": "command", "words": "ready to move", "fri": "CMD",
            "quality": "PERFECT", "mode": "POSITION", "power": True, "allowed": True, "held": False, "reason": "",
            "cycle": 0.005},
    "hand": {"alive": True, "connected": True, "calibrated": True, "calibrating": False, "holding": False,
             "message": "", "motors": 5},
    "manager": {"alive": True, "state": "idle", "active": "dmp", "reason": "", "scale": 1.0},
    "contact": {"words": "", "alive": True, "state": "off", "mode": "", "learnt": True, "samples": 9, "k": 6.0,
                "window": 0.04},
}  # fmt: skip


class Desk:
    """A console in its own thread, with 30 states per second, and a browser at its page. `model`: changes of that
    document; `files`: changes of the paths of the page's files."""

    def __init__(self, folder, model=None, **files):
        self.robot = RobotDouble()
        self._documents = {**PAGE_DOCUMENTS, "model": {**PAGE_DOCUMENTS["model"], **(model or {})}}
        self._files = files
        self.state: dict = {}  # values of the next states that differ from those of a robot at rest
        self.loop = asyncio.new_event_loop()
        self._ready, self._over = threading.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self.loop.run_until_complete, args=(self._serve(folder),))
        self._thread.start()
        assert self._ready.wait(60.0)
        self.browser = PageBrowser()
        self.browser.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": IN_HAND})
        self.browser.open(self.console.link())

    async def _serve(self, folder):
        async with running(folder, self.robot, **self._files) as self.console:
            for name, value in self._documents.items():
                self.console.documents.put(name, value)
            self._ready.set()
            while not self._over.is_set():
                self.console.server.publish_state({**page_state(time.monotonic()), **self.state})
                await asyncio.sleep(1 / 30)

    def event(self, text):
        self.loop.call_soon_threadsafe(self.console.events.add, "test", text)

    def put(self, **documents):
        """Sets documents by name."""
        for name, value in documents.items():
            self.loop.call_soon_threadsafe(self.console.documents.put, name, value)

    def close(self):
        self.browser.__exit__()
        self.loop.call_soon_threadsafe(self._over.set)
        self._thread.join(60.0)
