"""Finds introspection servers and sets initial states of their containers."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

import rospy
import smach
from smach_msgs.msg import SmachContainerInitialStatusCmd, SmachContainerStatus

from smach_ros.plain_data import InvalidDataError, decode, encode, to_plain

STATUS_TOPIC = "/smach/container_status"
STRUCTURE_TOPIC = "/smach/container_structure"
INIT_TOPIC = "/smach/container_init"


class IntrospectionClient:
    """Finds introspection servers and sets initial states of their containers.

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
        """Request the container at `path` to begin with these states and this user data.

        With a `timeout` (rospy.Duration or seconds) the command is repeated every 0.3 s until a status of
        the container confirms it (True) or the time has passed (False). Without a `timeout` it is sent once
        when a server is connected; True if one connects within 2 s. Example: see the class.
        """
        data = initial_userdata._data if initial_userdata is not None else {}
        wanted = to_plain(dict(data))
        command = SmachContainerInitialStatusCmd(
            path=path, initial_states=list(initial_states), local_data=encode(data)
        )
        shown = threading.Event()

        def on_status(msg: SmachContainerStatus) -> None:
            if msg.path == path and list(msg.initial_states) == list(initial_states) and _shows(msg.local_data, wanted):
                shown.set()

        publisher = rospy.Publisher(server + INIT_TOPIC, SmachContainerInitialStatusCmd, queue_size=1)
        subscriber = rospy.Subscriber(server + STATUS_TOPIC, SmachContainerStatus, on_status)
        try:
            if timeout is None:
                return self._send_once(publisher, command)
            wait = float(timeout.to_sec()) if hasattr(timeout, "to_sec") else float(timeout)
            deadline = time.monotonic() + wait
            while time.monotonic() < deadline and not rospy.is_shutdown():
                # Only a status after a command confirms it: the container may have had these initial states
                # before, with other data.
                if publisher.get_num_connections() > 0:
                    publisher.publish(command)
                if shown.wait(min(0.3, max(0.0, deadline - time.monotonic()))):
                    return True
            return shown.is_set()
        finally:
            drain(publisher)
            publisher.unregister()
            subscriber.unregister()

    @staticmethod
    def _send_once(publisher: rospy.Publisher, command: SmachContainerInitialStatusCmd) -> bool:
        limit = time.monotonic() + 2.0
        while publisher.get_num_connections() == 0:
            if time.monotonic() > limit or rospy.is_shutdown():
                smach.logerr(f"no subscriber on {publisher.name}; is the introspection server running?")
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


def drain(topic: Any) -> None:
    """Wait until a publisher's connections have sent their queues, at most 0.5 s."""
    limit = time.monotonic() + 0.5
    waiting = True
    while waiting and time.monotonic() < limit:
        links = getattr(topic.impl, "connections", None) or []
        waiting = any(getattr(link, "_queue", None) for link in links)
        time.sleep(0.01)
