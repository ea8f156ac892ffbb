"""A console on a free port of loopback with a double in place of the robot, for tests of the core."""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import socket
import time
from collections.abc import Iterable
from pathlib import Path

import aiohttp
from aiohttp import web
from coglab_console.desk.control_conditions import Standing
from coglab_console.desk.desk import Desk, DeskReply
from coglab_console.desk.events import EventLog
from coglab_console.web.access import CSRF_HEADER, Access, allowed_hosts
from coglab_console.web.fan_out import Documents
from coglab_console.web.page_files import load_all
from coglab_console.web.server import ConsoleServer

PAGE = Path(__file__).resolve().parents[1] / "page"
READY = dict(
    master_there=True,
    master_alive=True,
    state="/coglab_master/wait_without_object",
    in_hub=True,
    arm_alive=True,
    actions=("exchange_human_to_robot", "take"),
    motion_allowed=True,
    hand_alive=True,
    hand_connected=True,
    manager_alive=True,
    detector_alive=True,
    database_alive=True,
)

PAGE_DOCUMENTS = {
    "model": {
        "real": False,
        "robot": None,
        "order": [],
        "workspace": {"low": [-1.2, -1.2, 0.0], "high": [1.2, 1.2, 1.6]},
        "missing": [],
        "charts": False,
        "three": False,
    },
}


def page_state(stamp: float) -> dict:
    """A state of a robot at rest, as the node sends it."""
    return {
        "stamp": stamp,
        "q": [],
        "live": True,
        "silent": {},
        "frames": {},
        "ages": {},
        "rate": [0.0] * 7,
        "threshold": [0.12] * 7,
        "watched": [True] * 7,
        "speed": 0.0,
        "fri": 0.4,
        "answer": 0.1,
        "current": [0] * 5,
        "margin": None,
        "phase": READY["state"],
        "words": "ready, the hand is empty",
        "waits": "",
        "since": 1.0,
        "left": None,
        "dmp": ["idle", 0.0, 0.0, 0.0],
    }


class RobotDouble:
    """Records its requests."""

    def __init__(self, real: bool = False) -> None:
        self.real = real
        self.now = Standing(**READY)
        self.stops: list[str] = []
        self.calls: list[tuple[str, dict]] = []
        self.published: list[tuple[str, str]] = []
        self.marks: list[dict[str, str]] = []
        self.stop_times: list[float] = []

    def standing(self) -> Standing:
        return self.now

    def stop(self, who: str) -> None:
        self.stops.append(who)
        self.stop_times.append(time.monotonic())

    def publish(self, name: str, text: str) -> None:
        self.published.append((name, text))

    def mark(self, names: dict[str, str]) -> None:
        self.marks.append(names)

    async def call(self, name: str, arguments: dict) -> DeskReply:
        self.calls.append((name, arguments))
        return DeskReply(True, "done")


class Console:
    """A web server with its desk, events and documents."""

    def __init__(self, folder: Path, robot: RobotDouble, hosts: Iterable[str] = (), **files: object) -> None:
        self.robot, self.socket = robot, socket.socket()
        self.socket.bind(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.host = f"127.0.0.1:{self.port}"
        self.url, self.origin = f"http://{self.host}", f"http://{self.host}"
        self.access = Access(allowed_hosts("127.0.0.1", self.port, hosts))
        self.events, self.documents = EventLog(time.time), Documents()
        self.desk = Desk(robot, self.events, self.documents, folder, time.time, self.link)
        page, self.missing = load_all(PAGE, **files)
        self.server = ConsoleServer(self.access, self.desk, self.events, self.documents, page, "c", "run1")
        self.events.listen(lambda _event: self.server.wake())

    def link(self) -> str:
        return f"{self.url}/?t={self.access.new_token()}"

    @property
    def headers(self) -> dict[str, str]:
        """Headers of a POST by the console's own page."""
        return {"Origin": self.origin, CSRF_HEADER: "1"}

    @contextlib.asynccontextmanager
    async def browser(self):
        """A client with a session; nothing but its cookie."""
        jar = aiohttp.CookieJar(unsafe=True)
        async with aiohttp.ClientSession(cookie_jar=jar) as client:
            async with client.get(self.link(), allow_redirects=False) as response:
                assert response.status == 302
            yield client

    async def post(
        self, client: aiohttp.ClientSession, name: str, arguments: dict | None = None, **more
    ) -> tuple[int, dict]:
        body = {"name": name, "arguments": arguments or {}}
        async with client.post(f"{self.url}/api/command", json=body, headers={**self.headers, **more}) as response:
            return response.status, await response.json()

    def socket_of(self, client: aiohttp.ClientSession, **more):
        return client.ws_connect(f"ws://{self.host}/ws", headers={"Origin": self.origin, **more})


@contextlib.asynccontextmanager
async def running(folder: Path, robot: RobotDouble | None = None, **files: object):
    """A console that serves, with its 10 Hz tick."""
    console = Console(folder, robot or RobotDouble(), **files)
    runner = web.AppRunner(console.server.app, access_log=None)
    await runner.setup()
    await web.SockSite(runner, console.socket, shutdown_timeout=0.2).start()

    async def ticks() -> None:
        while True:
            console.desk.tick()
            await asyncio.sleep(0.05)

    task = asyncio.create_task(ticks())
    try:
        yield console
    finally:
        task.cancel()
        await runner.cleanup()


def served(robot: type[RobotDouble] = RobotDouble, program: bool = False, **files: object):
    """Makes a coroutine a test. `console`: serves 120 s; `client`: of a browser, or of a program without cookies."""

    def of(test):
        asked = inspect.signature(test).parameters

        async def inside(folder, given):
            async with running(folder, robot(), **files) as console:
                given["console"] = console
                if "client" not in asked:
                    return await asyncio.wait_for(test(**given), 120)
                new = aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) if program else console.browser()
                async with new as given["client"]:
                    await asyncio.wait_for(test(**given), 120)

        def run(tmp_path, **given):
            if "tmp_path" in asked:
                given["tmp_path"] = tmp_path
            asyncio.run(inside(tmp_path, given))

        names = ["tmp_path", *(name for name in asked if name not in ("console", "client", "tmp_path"))]
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
        run.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])
        run.__name__, run.__doc__ = test.__name__, test.__doc__
        return run

    return of
