"""Shows running machines to viewers, and lets viewers set the initial states of machines.

Topics of a server, in the namespace of its node unless its name begins with '/':

* `<server>/smach/container_structure`: the graph of every container, repeated every 2 s;
* `<server>/smach/container_status`: the status of every container: at the start, at each transition, at
  the end, and every 2 s;
* `<server>/smach/container_init`: subscribed; commands that set initial states.

The path of a container is the path of its parent, a slash and its label. The outermost container is by
convention /SM_ROOT.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import rospy
import smach
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)

from smach_ros.introspection_client import (
    INIT_TOPIC,
    STATUS_TOPIC,
    STRUCTURE_TOPIC,
    IntrospectionClient,
    drain,
)
from smach_ros.plain_data import InvalidDataError, decode, encode

__all__ = [
    "INIT_TOPIC",
    "STATUS_TOPIC",
    "STRUCTURE_TOPIC",
    "ContainerProxy",
    "IntrospectionClient",
    "IntrospectionServer",
]

#: Seconds of wall time between two heartbeats, which also continue while simulated time stands still.
HEARTBEAT = 2.0
#: Seconds after its connection in which a viewer receives no heartbeat. A viewer that subscribes before its
#: window exists loses earlier messages, and some viewers then never show anything.
WELCOME_DELAY = 1.5
#: Statuses that may wait for the publishing thread. If more wait, the oldest is dropped and counted.
BACKLOG = 20_000


class _Watched:
    """One container with its path: records its statuses and passes them to the server."""

    def __init__(self, server: IntrospectionServer, path: str, container: smach.Container) -> None:
        self.server, self.path, self.container = server, path, container

    def attach(self) -> None:
        self.container.register_start_cb(self.on_start)
        self.container.register_transition_cb(self.on_transition)
        self.container.register_termination_cb(self.on_termination)
        self.container.register_end_cb(self.on_end)

    def detach(self) -> None:
        callbacks: tuple[Callable, ...] = (self.on_start, self.on_transition, self.on_termination, self.on_end)
        for cb in callbacks:
            self.container.unregister_cb(cb)

    # The container calls these in its own thread: record a snapshot and return at once.

    def on_start(self, _userdata: Any, initial_states: Sequence[str]) -> None:
        self.server._enqueue(self.snapshot(f"START {list(initial_states)}"))

    def on_transition(self, _userdata: Any, *args: Any) -> None:
        self.server._enqueue(self.snapshot(", ".join(map(str, args))))

    def on_termination(self, _userdata: Any, terminal_states: Any, outcome: str | None) -> None:
        self.server._enqueue(self.snapshot(f"TERMINATION {terminal_states} {outcome}"))

    def on_end(self, _userdata: Any, outcome: str | None) -> None:
        self.server._enqueue(self.snapshot(f"END {outcome}"))

    def snapshot(self, info: str) -> tuple[SmachContainerStatus, dict]:
        """A status without user data, and the current user data."""
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


class _Beat:
    """Time of the next heartbeat, in seconds of wall time."""

    def __init__(self, now: float, period: float) -> None:
        self.period, self.last, self.due = period, now, now

    def done(self, now: float, spared_until: float | None = None) -> None:
        """Record that a heartbeat was sent, except to viewers that connected less than WELCOME_DELAY ago. They get
        one at `spared_until`. Missed heartbeats are not repeated."""
        self.last = now
        self.due += self.period
        if self.due < now:
            self.due = now + self.period
        if spared_until is not None:
            self.due = min(self.due, spared_until)

    def newcomer(self, now: float) -> None:
        """Schedule a heartbeat for a new viewer, WELCOME_DELAY after its connection."""
        self.due = min(self.due, now + WELCOME_DELAY)


class _Viewers:
    """The connections of a publisher with their start, in seconds of wall time."""

    def __init__(self, publisher: rospy.Publisher) -> None:
        self.publisher = publisher
        self._since: dict[Any, float] = {}
        self._lock = threading.Lock()

    def look(self, now: float) -> None:
        """Update the connections."""
        with self._lock:
            self._since = {c: self._since.get(c, now) for c in self.publisher.impl.connections}

    def spared_until(self, now: float) -> float | None:
        """Earliest time at which a new viewer may receive a heartbeat; None if no viewer is new."""
        self.look(now)
        return min((s + WELCOME_DELAY for s in self._since.values() if now < s + WELCOME_DELAY), default=None)

    def publish(self, message: Any, now: float) -> None:
        """Publish to all viewers that are connected for at least WELCOME_DELAY."""
        self.look(now)
        for connection in [c for c, since in self._since.items() if now >= since + WELCOME_DELAY]:
            topic = self.publisher.impl
            topic.acquire()
            try:
                topic.publish(message, connection)
            finally:
                topic.release()


class _Newcomers(rospy.SubscribeListener):
    """Notifies the server when a viewer has connected."""

    def __init__(self, server: IntrospectionServer) -> None:
        super().__init__()
        self._server = server

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        self._server._welcome()


class IntrospectionServer:
    """Publishes structure and status of a machine and all containers in it, from one thread.

    User data is shown as plain data; other values are shown by their repr. Neither viewers nor user
    data can block or stop the machine.

    Example::

        server = IntrospectionServer("executive", machine, "/SM_ROOT")
        server.start()
        machine.execute()
        server.stop()
    """

    def __init__(self, server_name: str, state: smach.State, path: str) -> None:
        self._server_name, self._state, self._path = server_name, state, path
        self._watched: list[_Watched] = []
        self._viewers: list[_Viewers] = []
        self._backlog: deque[tuple[SmachContainerStatus, dict]] = deque()
        self._dropped = 0
        self._changed = threading.Condition()
        self._beat = _Beat(time.monotonic(), HEARTBEAT)
        self._running = False
        self._thread: threading.Thread | None = None
        self._status_pub: rospy.Publisher | None = None
        self._structure_pub: rospy.Publisher | None = None
        self._init_sub: rospy.Subscriber | None = None

    def start(self) -> None:
        """Start publishing.

        Example: `server.start()` after `rospy.init_node`. A second start has no effect.
        """
        if self._running:
            return
        if not self._watched:
            self.construct(self._server_name, self._state, self._path)
        queue_size = max(1000, 4 * len(self._watched))  # a burst that a busy computer sends late
        options = {"queue_size": queue_size, "subscriber_listener": _Newcomers(self)}
        self._status_pub = rospy.Publisher(self._server_name + STATUS_TOPIC, SmachContainerStatus, **options)
        self._structure_pub = rospy.Publisher(self._server_name + STRUCTURE_TOPIC, SmachContainerStructure, **options)
        self._viewers = [_Viewers(self._structure_pub), _Viewers(self._status_pub)]
        self._running = True
        for watched in self._watched:
            watched.attach()
            self._enqueue(watched.snapshot("Initial state"))
        self._init_sub = rospy.Subscriber(self._server_name + INIT_TOPIC, SmachContainerInitialStatusCmd, self._on_init)
        self._thread = threading.Thread(target=self._work, name=f"smach_introspection:{self._server_name}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Send the waiting messages, then remove all publishers, callbacks and threads.

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
                drain(topic)
                topic.unregister()
        self._init_sub = self._status_pub = self._structure_pub = self._thread = None
        self._viewers = []

    def construct(self, server_name: str, state: smach.State, path: str) -> None:
        """Watch `state` under `path`, and the containers in it. `start` calls it if it has not been called.

        Example: `server.construct("executive", machine, "/SM_ROOT")`.
        """
        if not self._watch(state, path) or not isinstance(state, smach.Container):
            return
        for label, child in state.get_children().items():
            if isinstance(child, smach.Container):
                self.construct(server_name, child, path.rstrip("/") + "/" + label)

    def _watch(self, state: smach.State, path: str) -> bool:
        if not isinstance(state, smach.Container):
            smach.logwarn(f"introspection of {path!r}: expected a container, got {type(state).__name__}; not shown")
            return False
        watched = _Watched(self, path, state)
        self._watched = [*self._watched, watched]
        if self._running:
            watched.attach()
            self._enqueue(watched.snapshot("Initial state"))
        return True

    def clear(self) -> None:
        """Stop watching all containers.

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
        while True:
            with self._changed:
                while self._running and not self._backlog and time.monotonic() < self._beat.due:
                    self._changed.wait(max(0.0, self._beat.due - time.monotonic()))
                running = self._running
                items, dropped = list(self._backlog), self._dropped
                self._backlog.clear()
                self._dropped = 0
                now = time.monotonic()
                beat = self._is_due(now)
            if dropped:
                smach.logwarn(f"introspection is behind the machine: {dropped} statuses dropped")
            for message, data in items:
                self._publish_status(message, data)
            if not running or rospy.is_shutdown():
                return
            if beat:
                self._publish_heartbeats(now)

    def _is_due(self, now: float) -> bool:
        if now < self._beat.due:
            return False
        spared = [viewers.spared_until(now) for viewers in self._viewers]
        self._beat.done(now, min((s for s in spared if s is not None), default=None))
        return True

    def _welcome(self) -> None:
        """A viewer has connected: schedule a heartbeat for it."""
        with self._changed:
            now = time.monotonic()
            for viewers in self._viewers:
                viewers.look(now)
            self._beat.newcomer(now)
            self._changed.notify()

    def _publish_heartbeats(self, now: float) -> None:
        for watched in self._watched:
            try:
                for viewers in self._viewers:
                    if viewers.publisher.get_num_connections() == 0:
                        continue
                    if viewers.publisher is self._structure_pub:
                        viewers.publish(watched.structure(), now)
                    else:
                        message, data = watched.snapshot("HEARTBEAT")
                        message.local_data = encode(data)
                        viewers.publish(message, now)
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
        """Process a command from outside after checking all of its values."""
        for watched in self._watched:
            if watched.path != msg.path:
                continue
            try:
                unknown = [label for label in msg.initial_states if label not in watched.container.get_children()]
                if unknown:
                    raise InvalidDataError(
                        f"{unknown[:5]} are not among the children {list(watched.container.get_children())}"
                    )
                userdata = smach.UserData()
                userdata.update(decode(msg.local_data))
                watched.container.set_initial_state(list(msg.initial_states), userdata)
                self._enqueue(watched.snapshot("REMOTE_INIT"))
            except InvalidDataError as error:
                smach.logerr(f"command for {msg.path} refused: {error}")
            except Exception:
                smach.logerr(f"command for {msg.path} failed:\n{traceback.format_exc()}")


class ContainerProxy:
    """Shows one container, without the containers in it. `update_rate` (rospy.Duration): interval of heartbeats.

    Example::

        proxy = ContainerProxy("executive", machine, "/SM_ROOT")
        proxy.start()
        machine.execute()
        proxy.stop()
    """

    def __init__(
        self,
        server_name: str,
        container: smach.Container,
        path: str,
        update_rate: rospy.Duration = rospy.Duration(HEARTBEAT),  # noqa: B008  as elsewhere
    ) -> None:
        self._server = IntrospectionServer(server_name, container, path)
        self._server._beat.period = update_rate.to_sec()
        self._server._watch(container, path)

    def start(self) -> None:
        """Start publishing. Example: `proxy.start()`."""
        self._server.start()

    def stop(self) -> None:
        """Stop publishing and remove everything. Example: `proxy.stop()`."""
        self._server.stop()
