"""The way of a STOP: three at once, none of which waits for another, for the ROS master, or for the event loop.

`hold` on the topic lwr/ros_events, `hold` by the service lwr/command, and the service coglab/stop. The topic goes over
a connection that stands already. The addresses of the services are asked from the master beforehand, again and again,
so that a master which does not answer any more is not asked when it counts.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from coglab_msgs.srv import LwrCommand
from coglab_py.steady import worker
from rospy.core import parse_rosrpc_uri
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ..desk.words import plain

ANSWER_LIMIT = 3.0  # s until a missing answer is told
MAX_WAITING = 8  # threads whose service has not answered


class DirectService(rospy.ServiceProxy):
    """A service whose address is known beforehand; where the known one fails, the master is asked."""

    address: str | None = None

    def refresh(self) -> None:
        """Asks the master; may wait as long as the master does."""
        try:
            self.address = rospy.get_master().lookupService(self.resolved_name)[2] or self.address
        except Exception:  # it is not offered now, or the master is away: the known address stays
            pass

    def _get_service_uri(self, request: object) -> str:
        address, self.address = self.address, None  # a stale one is used once
        if address:
            try:
                parse_rosrpc_uri(address)
                return address
            except rospy.ServiceException:
                pass
        return super()._get_service_uri(request)


class StopPath:
    """Call `press` from any thread; `say(text, level)` gets the outcomes."""

    def __init__(self, say: Callable[[str, str], None]) -> None:
        self._say = say
        self._topic = rospy.Publisher("lwr/ros_events", String, queue_size=5, tcp_nodelay=True)
        self._arm = DirectService("lwr/command", LwrCommand)
        self._brain = DirectService("coglab/stop", Trigger)
        self._waiting = threading.Semaphore(MAX_WAITING)
        self._keeper = worker(self._keep, "stop_addresses")
        self._keeper.start()

    def press(self, who: str) -> None:
        """Returns at once. A press while eight services have not answered goes by the topic alone."""
        self._topic.publish(String("hold"))  # a queue of its own and a thread per connection: never waits
        began = time.monotonic()
        for name, call in (("arm", lambda: self._arm("hold")), ("brain", lambda: self._brain())):
            if self._waiting.acquire(blocking=False):
                threading.Thread(target=self._ask, args=(name, call, began), name=f"stop_{name}", daemon=True).start()
        self._say(f"STOP by {who}", "fault")

    def _ask(self, name: str, call: Callable[[], Any], began: float) -> None:
        watch = threading.Timer(
            ANSWER_LIMIT,
            self._say,
            (f"STOP: the {name} has not answered for {ANSWER_LIMIT:.0f} s; use the red button of the robot", "fault"),
        )
        watch.daemon = True
        watch.start()
        try:
            answer = call()
            took = 1000 * (time.monotonic() - began)
            self._say(f"STOP, {name}: {plain(answer.message)} ({took:.0f} ms)", "info" if answer.success else "fault")
        except Exception as error:
            self._say(f"STOP: the {name} cannot be asked ({error}); if the arm moves, use the red button", "fault")
        finally:
            watch.cancel()
            self._waiting.release()

    def _keep(self) -> None:
        while not rospy.is_shutdown():
            self._arm.refresh()
            self._brain.refresh()
            time.sleep(1.0)
