"""The node /coglab_console: connects view, commands, STOP and the web server."""

from __future__ import annotations

import asyncio
import os
import secrets
import signal
import sys
import time
from pathlib import Path
from typing import Any

import rosgraph
import rospkg
import rospy
from aiohttp import web
from coglab_py import parameters
from rospy.exceptions import ROSInitException

from ..desk.desk import Desk
from ..desk.events import EventLog
from ..scene.urdf_model import ModelError, RobotModel
from ..web.access import Access, allowed_hosts
from ..web.fan_out import Documents
from ..web.page_files import load_all
from ..web.server import ConsoleServer
from .commands import RosBackend, StopPath
from .graph import SmachGraphs
from .knowledge import Knowledge
from .startup import StartError, announce, bind, exposure, look_for_another, only_one, versions
from .tables import SILENT_DIAGNOSTICS
from .view import RosView

ADDRESS, PORT = "127.0.0.1", 8790
STATE_RATE = 30.0  # Hz
TICK = 0.1  # s
HEALTH = 1.0  # s
FRAMES = {"human_hand": "human_hand", "board": "board"}


def words_of_age(age: float) -> str:
    """Note on the diagnostics of a silent node; empty if the node is not silent."""
    return f" (silent for {age:.0f} s)" if age >= SILENT_DIAGNOSTICS else ""


class ConsoleNode:
    """All parts of one console, from start to end."""

    def __init__(self, loop: asyncio.AbstractEventLoop, home: Path) -> None:
        self.loop, self.home = loop, home
        self.address = parameters.read("~address", str, ADDRESS)
        port = parameters.read("~port", int, PORT, 0, 65535)
        self.socket = bind(self.address, port, port != PORT)
        self.port = self.socket.getsockname()[1]
        more = parameters.read("~hosts", str, "").split()
        self.access = Access(allowed_hosts(self.address, self.port, more))
        self.events, self.documents = EventLog(time.time), Documents()
        self.real = parameters.read("~real", bool, False)
        model = self._model()
        self.graphs = SmachGraphs(self.put, lambda text, level: self.say("graph", text, level))
        frames = {**FRAMES, **parameters.read("perception/frames", dict, {})}
        self.view = RosView(model, frames, self.say, self.put, self.graphs.transition, self._on_result)
        self.events.phase = self.view.phase
        self.stop_path = StopPath(lambda text, level: self.say("stop", text, level))
        backend = RosBackend(self.view, self.stop_path.press, self.real)
        folder = Path(parameters.read("~sessions", str, "") or home / "console_sessions")
        self.desk = Desk(backend, self.events, self.documents, folder, time.time, self.write_link)
        backend.listen(lambda name, text, who: self.soon(self.desk.set_from_topic, name, text, who))
        self.knowledge = Knowledge(
            self.view, self.put, lambda text, level: self.say("files", text, level), lambda: self.desk.object_id
        )
        page = Path(rospkg.RosPack().get_path("coglab_console")) / "page"
        files, missing = load_all(page)
        for package in missing:
            self.say(
                "console",
                f"{package} is missing (apt install {package}): "
                + ("the 2D view takes the place of the 3D view" if "three" in package else "there are no strip charts"),
                "warning",
            )
        self.server = ConsoleServer(
            self.access,
            self.desk,
            self.events,
            self.documents,
            files,
            f"coglab_console_{self.port}",
            secrets.token_hex(8),
            self.write_link,
        )
        self.events.listen(lambda _event: self.soon(self.server.wake))
        self.view.listen()
        self._put_static(model, missing, files)

    # --- from other threads -----------------------------------------------------------------------------------

    def soon(self, callback: Any, *arguments: Any) -> None:
        """Calls it in the event loop, if the loop still runs."""
        try:
            self.loop.call_soon_threadsafe(callback, *arguments)
        except RuntimeError:  # the loop has ended
            pass

    def say(self, source: str, text: str, level: str = "info", phase: str | None = None) -> None:
        """Adds an event, from any thread."""
        self.events.add(source, text, level, phase)

    def put(self, name: str, value: Any) -> None:
        """Sets a document, from any thread; None removes it."""
        if value is None:
            self.soon(self.documents.remove, name)
        else:
            self.soon(self.documents.put, name, value)

    def _on_result(self, row: dict) -> None:
        self.soon(self.desk.result, row)

    # --- at the start -----------------------------------------------------------------------------------------

    def _model(self) -> RobotModel | None:
        urdf = parameters.found_above("robot_description", str)
        try:
            if urdf is None:
                raise ModelError("the parameter robot_description is missing")
            return RobotModel(urdf)
        except ModelError as error:
            self.say("console", f"the robot is not drawn: {error}", "warning")
            return None

    def _put_static(self, model: RobotModel | None, missing: list[str], files: dict) -> None:
        workspace = parameters.read("controller_manager/workspace", dict, {})
        self.documents.put(
            "model",
            {
                "real": self.real,
                "robot": model.document() if model else None,
                "order": model.moving() if model else [],
                "workspace": {
                    "low": workspace.get("box_min", [-1.2, -1.2, 0.0]),
                    "high": workspace.get("box_max", [1.2, 1.2, 1.6]),
                },
                "missing": missing,
                "charts": "/lib/dygraphs/dygraph.js" in files,
                "three": "/lib/three/build/three.module.js" in files,
                "colours": {"arm": "#d9822b"},
            },
        )
        self.versions = {
            **versions(),
            "console": f"http://{self.address}:{self.port}",
            "ROS master": os.environ.get("ROS_MASTER_URI", ""),
            "packed page": f"{sum(len(file.packed) for file in files.values()) / 1e6:.2f} MB",
        }

    def write_link(self) -> str:
        """Makes a link for one browser and writes it to console.url. An earlier link stays valid until it is used."""
        name = "127.0.0.1" if self.address in ("0.0.0.0", "") else self.address
        link = f"http://{name}:{self.port}/?t={self.access.new_token()}"
        path = self.home / "console.url"
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            os.fchmod(handle, 0o600)
            with os.fdopen(handle, "w") as stream:
                stream.write(link + "\n")
        except OSError as error:
            self.say("console", f"{path} cannot be written ({error.strerror}); Help makes links, too", "warning")
        return link

    # --- while it runs ----------------------------------------------------------------------------------------

    async def run(self, ended: asyncio.Event) -> None:
        """Serves until `ended`."""
        runner = web.AppRunner(self.server.app, access_log=None, handle_signals=False)
        await runner.setup()
        await web.SockSite(runner, self.socket, shutdown_timeout=1.0).start()
        print(
            f"[coglab] console: {self.write_link()}   (one use; the next one is in {self.home / 'console.url'})",
            flush=True,
        )
        if exposure(self.address):
            rospy.logwarn(exposure(self.address))
            self.say("console", exposure(self.address), "warning")
        self.say("console", f"console started, {'REAL ROBOT' if self.real else 'simulation'}")
        tasks = [asyncio.create_task(work()) for work in (self._states, self._ticks, self._health)]
        await ended.wait()
        for task in tasks:
            task.cancel()
        await runner.cleanup()

    async def _states(self) -> None:
        """Publishes the state at STATE_RATE without drift. A busy computer skips states."""
        due = self.loop.time()
        while True:
            due = max(due + 1.0 / STATE_RATE, self.loop.time())
            await asyncio.sleep(max(0.0, due - self.loop.time()))
            if self.server.clients:
                self._careful(lambda: self.server.publish_state(self.view.frame()))

    async def _ticks(self) -> None:
        while True:
            await asyncio.sleep(TICK)
            self._careful(self._tick)

    def _tick(self) -> None:
        self.desk.observe(*self.view.stopped())
        self.desk.tick()
        self.documents.put("status", self.view.status())

    async def _health(self) -> None:
        while True:
            await asyncio.sleep(HEALTH)
            self._careful(self._put_health)

    def _put_health(self) -> None:
        now = time.monotonic()
        rows = [
            {
                "name": name,
                "level": row["level"] if now - row["at"] < SILENT_DIAGNOSTICS else 3,
                "message": row["message"] + words_of_age(now - row["at"]),
                "values": row["values"],
            }
            for name, row in sorted(self.view.tables.diagnostics.items())
        ]
        browsers = [{"name": one.name, "connections": one.sockets} for one in self.access.sessions() if one.sockets]
        self.documents.put("busy", self.view.tables.busy(now))
        self.documents.put("health", {"rows": rows, "versions": self.versions, "browsers": browsers})

    def _careful(self, work: Any) -> None:
        """Runs `work` and logs an exception, because no message may end the loop."""
        try:
            work()
        except Exception as error:
            rospy.logerr_throttle(10.0, f"console: {type(error).__name__}: {error}")


async def _main(home: Path) -> None:
    loop = asyncio.get_running_loop()
    node = await loop.run_in_executor(None, ConsoleNode, loop, home)
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    rospy.on_shutdown(lambda: node.soon(ended.set))
    await node.run(ended)


def main() -> int:
    """Runs the console. Exit status 1 if it cannot start."""
    home = Path(rospkg.get_ros_home())
    try:
        home.mkdir(parents=True, exist_ok=True)
        lock = only_one(home)
        master = rosgraph.Master("/coglab_console")
        look_for_another(master)
        rospy.init_node("coglab_console", disable_signals=True)
        announce(master, rospy.get_node_uri())
        asyncio.run(_main(home))
        os.close(lock)
    except (StartError, parameters.ParameterError, ROSInitException, rosgraph.MasterException, OSError) as error:
        print(f"[coglab] console: error: {error}", file=sys.stderr, flush=True)
        return 1
    finally:
        rospy.signal_shutdown("the console ends")
    return 0
