"""The node /trial_recorder: records every handover with `recorder.py`. `config/recorder.yaml` lists the recorded
topics."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import rosgraph
import rospy
from coglab_py.node_start import answer, init_node
from coglab_py.steady import Stamps, ending, spin, worker

from coglab_tools.trial.record import trials_folder
from coglab_tools.trial.recorder import Raw, Recorder

PERIOD = 0.1  # s between two writes


class RecorderNode:
    """Connects the recorder to ROS. Private parameters: `folder` (empty: `trials_folder()`), `topics` (list of names
    relative to the namespace), `min_free_mb` (free space of the disk that is kept)."""

    def __init__(self) -> None:
        given = str(rospy.get_param("~folder", "")).strip()
        folder = Path(given).expanduser() if given else trials_folder()
        topics = rospy.get_param("~topics", [])
        if not isinstance(topics, list) or not all(isinstance(each, str) and each for each in topics) or not topics:
            raise ValueError(f"~topics is a list of topic names, got {str(topics)[:100]!r}; see config/recorder.yaml")
        least = 1e6 * float(rospy.get_param("~min_free_mb", 500))
        self.recorder = Recorder(folder.absolute(), self._parameters, self._say, least)
        self._over, self._stamps = threading.Event(), Stamps()
        self._thread = worker(self._work, "recorder")
        self._thread.start()
        rospy.core.add_preshutdown_hook(lambda _reason: self._end())
        self._subscribers = [
            rospy.Subscriber(name, rospy.AnyMsg, self._take, rospy.resolve_name(name), queue_size=2000)
            for name in topics
        ]
        rospy.loginfo("every handover is recorded into %s", folder)

    def _take(self, message: Any, topic: str) -> None:
        now, ros = self._clocks()
        self.recorder.put(Raw(now, topic, message._buff, message._connection_header, ros))

    def _clocks(self) -> tuple[float, float]:
        """Time of the recorder and ROS time, s. The recorder follows /clock if it gives the time, otherwise the steady
        clock, as this computer's clock may be set during a handover."""
        if not rospy.rostime.is_wallclock():
            now = rospy.get_time()
            return now, now
        now = time.monotonic()
        return now, self._stamps.stamp(now).to_sec()

    def _work(self) -> None:
        while not self._over.wait(PERIOD) and not ending():
            self.recorder.step(self._clocks()[0])
        self.recorder.close()

    def _end(self) -> None:
        self._over.set()
        self._thread.join(10.0)

    @staticmethod
    def _parameters() -> dict[str, Any]:
        try:
            # not rospy.get_param(): for "/" it returns its cache, which is empty
            found = answer(rosgraph.get_master_uri(), "getParam", rospy.get_namespace())
        except TimeoutError:
            found = None
        if not isinstance(found, dict):
            rospy.logwarn("the parameters are not in trial.yaml: the ROS master did not return them")
            return {}
        return found

    @staticmethod
    def _say(sentence: str, wrong: bool) -> None:
        (rospy.logerr if wrong else rospy.loginfo)("%s", sentence)


def main() -> int:
    """Run the node. Exit status 1: it could not start."""
    init_node("trial_recorder")
    try:
        RecorderNode()
    except (ValueError, OSError) as error:
        rospy.logfatal("the recorder does not start: %s", error)
        return 1
    return spin()
