"""Shows running machines to viewers, and lets them choose where a machine begins.

Topics of a server, in the namespace of its node unless its name begins with '/':

* `<server>/smach/container_structure`: the graph of every container, again every 2 s;
* `<server>/smach/container_status`: what every container does, at start, at each transition, at
  the end, and every 2 s;
* `<server>/smach/container_init`: takes commands that set initial states.

The path of a container is that of its parent, a slash and its label; that of the outermost is by
convention /SM_ROOT.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections import deque
from collections.abc import Sequence
from typing import Any

import rospy
import smach
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)

from smach_ros.plain_data import InvalidDataError, decode, encode, to_plain

__all__ = [
    "INIT_TOPIC",
    "STATUS_TOPIC",
    "STRUCTURE_TOPIC",
    "IntrospectionClient",
    "IntrospectionServer",
]

STATUS_TOPIC = "/smach/container_status"
STRUCTURE_TOPIC = "/smach/container_structure"
INIT_TOPIC = "/smach/container_init"

#: Seconds of wall time between two heartbeats: visible also while simulated time stands still.
HEARTBEAT = 2.0
#: Statuses that may wait for the publishing thread; beyond it the oldest is dropped and counted.
BACKLOG = 20_000


class _Watched:
    """One container under its path: takes statuses of it, and hands them to the server."""

    def __init__(self, server: IntrospectionServer, path: str, container: smach.Container) -> None:
        self.server, self.path, self.container = server, path, container

    def attach(self) -> None:
        self.container.register_start_cb(self.on_start)
        self.container.register_transition_cb(self.on_transition)
        self.container.register_termination_cb(self.on_termination)
        self.container.register_end_cb(self.on_end)

    def detach(self) -> None:
        for cb in (self.on_start, self.on_transition, self.on_termination, self.on_end):
            self.container.unregister_cb(cb)

    # The container calls these in its own thread: take a snapshot and be gone.

    def on_start(self, _userdata: Any, initial_states: Sequence[str]) -> None:
        self.server._enqueue(self.snapshot(f"START {list(initial_states)}"))

    def on_transition(self, _userdata: Any, *args: Any) -> None:
        self.server._enqueue(self.snapshot(", ".join(map(str, args))))

    def on_termination(self, _userdata: Any, terminal_states: Any, outcome: str | None) -> None:
        self.server._enqueue(self.snapshot(f"TERMINATION {terminal_states} {outcome}"))

    def on_end(self, _userdata: Any, outcome: str | None) -> None:
        self.server._enqueue(self.snapshot(f"END {outcome}"))

    def snapshot(self, info: str) -> tuple[SmachContainerStatus, dict]:
        """A status without its user data, and the user data as it is now."""
        message = SmachContainerStatus(
            path=self.path,
            initial_states=list(self.container.get_initial_states()),
            active_states=list(self.container.get_active_states()),
            info=info,
        )
        message.header.stamp = rospy.Time.now()
        return message, dict(self.container.userdata._data)

    def structure(self) -> SmachContainerStructure:
        edges = self.container.get_internal_edges()
        message = SmachContainerStructure(
            path=self.path,
            children=list(self.container.get_children()),
            internal_outcomes=[outcome for outcome, _, _ in edges],
            outcomes_from=[source for _, source, _ in edges],
            outcomes_to=[str(target) for _, _, target in edges],
            container_outcomes=list(self.container.get_registered_outcomes()),
        )
        message.header.stamp = rospy.Time.now()
        return message


class _Newcomers(rospy.SubscribeListener):
    """Tells the server when a viewer has connected."""

    def __init__(self, server: IntrospectionServer) -> None:
        super().__init__()
        self._server = server

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        self._server._welcome()


class IntrospectionServer:
    """Publishes structure and status of a machine and all containers in it, from one thread.

    User data is shown as plain data; what is not plain shows as its repr. Neither viewers nor user
    data can hold up or stop the machine.

    Example::

        server = IntrospectionServer("executive", machine, "/SM_ROOT")
        server.start()
        machine.execute()
        server.stop()
    """

    def __init__(self, server_name: str, state: smach.State, path: str) -> None:
        self._server_name, self._state, self._path = server_name, state, path
        self._watched: list[_Watched] = []
        self._backlog: deque[tuple[SmachContainerStatus, dict]] = deque()
        self._dropped = 0
        self._changed = threading.Condition()
        self._newcomer = False
        self._running = False
        self._thread: threading.Thread | None = None
        self._status_pub: rospy.Publisher | None = None
        self._structure_pub: rospy.Publisher | None = None
        self._init_sub: rospy.Subscriber | None = None

    def start(self) -> None:
        """Begin to publish.

        Example: `server.start()` after `rospy.init_node`. A second start has no effect.
        """
        if self._running:
            return
        if not self._watched:
            self.construct(self._server_name, self._state, self._path)
        queue_size = max(100, 4 * len(self._watched))
        options = {"queue_size": queue_size, "subscriber_listener": _Newcomers(self)}
        self._status_pub = rospy.Publisher(
            self._server_name + STATUS_TOPIC, SmachContainerStatus, **options
        )
        self._structure_pub = rospy.Publisher(
            self._server_name + STRUCTURE_TOPIC, SmachContainerStructure, **options
        )
        self._running = True
        for watched in self._watched:
            watched.attach()
            self._enqueue(watched.snapshot("Initial state"))
        self._init_sub = rospy.Subscriber(
            self._server_name + INIT_TOPIC, SmachContainerInitialStatusCmd, self._on_init
        )
        self._thread = threading.Thread(
            target=self._work, name=f"smach_introspection:{self._server_name}", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Send what is left, and leave no publisher, callback or thread behind.

        Example: `server.stop()`.
        """
        if not self._running:
            return
        for watched in self._watched:
            watched.detach()
        with self._changed:
            self._running = False
            self._changed.notify()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(5.0)
        for topic in (self._init_sub, self._status_pub, self._structure_pub):
            if topic is not None:
                _drain(topic)
                topic.unregister()
        self._init_sub = self._status_pub = self._structure_pub = self._thread = None

    def construct(self, server_name: str, state: smach.State, path: str) -> None:
        """Watch `state` under `path`, and the containers in it. `start` calls it if nobody has.

        Example: `server.construct("executive", machine, "/SM_ROOT")`.
        """
        if not isinstance(state, smach.Container):
            smach.logwarn(
                f"introspection of {path!r}: expected a container, got {type(state).__name__}; not "
                "shown"
            )
            return
        watched = _Watched(self, path, state)
        self._watched = [*self._watched, watched]
        if self._running:
            watched.attach()
            self._enqueue(watched.snapshot("Initial state"))
        for label, child in state.get_children().items():
            if isinstance(child, smach.Container):
                self.construct(server_name, child, path.rstrip("/") + "/" + label)

    def clear(self) -> None:
        """Watch nothing any more.

        Example: `server.clear(); server.construct(name, other, "/SM_ROOT")`.
        """
        for watched in self._watched:
            watched.detach()
        self._watched = []

    def _enqueue(self, item: tuple[SmachContainerStatus, dict]) -> None:
        with self._changed:
            if len(self._backlog) >= BACKLOG:
                self._backlog.popleft()
                self._dropped += 1
            self._backlog.append(item)
            self._changed.notify()

    def _work(self) -> None:
        beat = time.monotonic()
        while True:
            with self._changed:
                while not self._work_to_do() and time.monotonic() < beat:
                    self._changed.wait(max(0.0, beat - time.monotonic()))
                running, newcomer = self._running, self._newcomer
                self._newcomer = False
                items, dropped = list(self._backlog), self._dropped
                self._backlog.clear()
                self._dropped = 0
            if dropped:
                smach.logwarn(f"introspection is behind the machine: {dropped} statuses dropped")
            for message, data in items:
                self._publish_status(message, data)
            if not running or rospy.is_shutdown():
                return
            if time.monotonic() >= beat:
                beat += HEARTBEAT
                if (
                    time.monotonic() > beat
                ):  # the process was suspended: do not make up for lost beats
                    beat = time.monotonic() + HEARTBEAT
                newcomer = True
            if newcomer:
                self._publish_heartbeats()

    def _work_to_do(self) -> bool:
        return bool(self._backlog) or self._newcomer or not self._running

    def _welcome(self) -> None:
        """Somebody has just subscribed: show everything at once, not at the next beat."""
        with self._changed:
            self._newcomer = True
            self._changed.notify()

    def _publish_heartbeats(self) -> None:
        for watched in self._watched:
            try:
                if (
                    self._structure_pub is not None
                    and self._structure_pub.get_num_connections() > 0
                ):
                    self._structure_pub.publish(watched.structure())
                if self._status_pub is not None and self._status_pub.get_num_connections() > 0:
                    self._publish_status(*watched.snapshot("HEARTBEAT"))
            except Exception:
                self._complain(f"heartbeat of {watched.path}")

    def _publish_status(self, message: SmachContainerStatus, data: dict) -> None:
        try:
            if self._status_pub is not None and self._status_pub.get_num_connections() > 0:
                message.local_data = encode(data)
                self._status_pub.publish(message)
        except Exception:
            self._complain(f"status of {message.path}")

    def _complain(self, what: str) -> None:
        if not rospy.is_shutdown():
            smach.logerr(f"introspection: {what} not published:\n{traceback.format_exc()}")

    def _on_init(self, msg: SmachContainerInitialStatusCmd) -> None:
        """A command from outside: believe nothing in it."""
        for watched in self._watched:
            if watched.path != msg.path:
                continue
            try:
                unknown = [
                    label
                    for label in msg.initial_states
                    if label not in watched.container.get_children()
                ]
                if unknown:
                    raise InvalidDataError(
                        f"{unknown[:5]} are not among the children "
                        f"{list(watched.container.get_children())}"
                    )
                userdata = smach.UserData()
                userdata.update(decode(msg.local_data))
                watched.container.set_initial_state(list(msg.initial_states), userdata)
                self._enqueue(watched.snapshot("REMOTE_INIT"))
            except InvalidDataError as error:
                smach.logerr(f"command for {msg.path} refused: {error}")
            except Exception:
                smach.logerr(f"command for {msg.path} failed:\n{traceback.format_exc()}")


def _drain(topic: Any) -> None:
    """Let a publisher's connections send what they hold, for at most half a second."""
    limit = time.monotonic() + 0.5
    waiting = True
    while waiting and time.monotonic() < limit:
        links = getattr(topic.impl, "connections", None) or []
        waiting = any(getattr(link, "_queue", None) for link in links)
        time.sleep(0.01)


class IntrospectionClient:
    """Finds introspection servers, and sets initial states of their containers.

    Example::

        client = IntrospectionClient()
        for server in client.get_servers():
            client.set_initial_state(server, "/SM_ROOT", ["GRASP"], timeout=rospy.Duration(5))
    """

    def get_servers(self) -> list[str]:
        """Absolute names of all servers on this master.

        Example: `IntrospectionClient().get_servers()`.
        """
        return sorted(
            topic[: -len(STATUS_TOPIC)]
            for topic, kind in rospy.get_published_topics()
            if kind == SmachContainerStatus._type and topic.endswith(STATUS_TOPIC)
        )

    def set_initial_state(
        self,
        server: str,
        path: str,
        initial_states: Sequence[str],
        initial_userdata: smach.UserData | None = None,
        timeout: Any = None,
    ) -> bool:
        """Ask the container at `path` to begin with these states and this user data.

        With a `timeout` (rospy.Duration or seconds) the command is repeated every 0.3 s until a
        status of the container shows it: True; else False. Without one it is sent once a server is
        connected, for which 2 s are allowed: True if it was sent. Example: see the class.
        """
        data = initial_userdata._data if initial_userdata is not None else {}
        wanted = to_plain(dict(data))
        command = SmachContainerInitialStatusCmd(
            path=path, initial_states=list(initial_states), local_data=encode(data)
        )
        shown = threading.Event()

        def on_status(msg: SmachContainerStatus) -> None:
            if (
                msg.path == path
                and list(msg.initial_states) == list(initial_states)
                and _shows(msg.local_data, wanted)
            ):
                shown.set()

        publisher = rospy.Publisher(
            server + INIT_TOPIC, SmachContainerInitialStatusCmd, queue_size=1
        )
        subscriber = rospy.Subscriber(server + STATUS_TOPIC, SmachContainerStatus, on_status)
        try:
            if timeout is None:
                return self._send_once(publisher, command)
            wait = float(timeout.to_sec()) if hasattr(timeout, "to_sec") else float(timeout)
            deadline = time.monotonic() + wait
            while time.monotonic() < deadline and not rospy.is_shutdown():
                # Only a status after a command counts: the container may have begun there anyway,
                # with other data.
                if publisher.get_num_connections() > 0:
                    publisher.publish(command)
                if shown.wait(min(0.3, max(0.0, deadline - time.monotonic()))):
                    return True
            return shown.is_set()
        finally:
            _drain(publisher)
            publisher.unregister()
            subscriber.unregister()

    @staticmethod
    def _send_once(publisher: rospy.Publisher, command: SmachContainerInitialStatusCmd) -> bool:
        limit = time.monotonic() + 2.0
        while publisher.get_num_connections() == 0:
            if time.monotonic() > limit or rospy.is_shutdown():
                smach.logerr(
                    f"nobody takes commands on {publisher.name}; is the introspection server "
                    "running?"
                )
                return False
            time.sleep(0.02)
        publisher.publish(command)
        return True


def _shows(local_data: str, wanted: dict) -> bool:
    try:
        data = decode(local_data)
    except InvalidDataError:
        return not wanted
    return all(key in data and data[key] == value for key, value in wanted.items())
