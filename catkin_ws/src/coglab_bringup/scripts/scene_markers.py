#!/usr/bin/python3
"""The node /scene_markers: markers for rviz, besides robot and person.

Publishes coglab/scene (visualization_msgs/MarkerArray, latched, 5 Hz): pedestal, board (frame `board`), during a motion
its goal (frame `dmp_goal`) and the path of the primitive from its start to that goal, and a line of text from
coglab/state. Subscribes controller_manager/dmp/feedback and coglab/state. Nothing in control reads any of it.
Parameters: coglab/dmp_library (XML file of the primitives), ~board_size (m along x, y of the frame `board`).
The path of a primitive that was loaded later from another file is not drawn.
"""

import sys
import threading
import time

import coglab_controllers as cc
import numpy as np
import rospy
import tf2_ros
from coglab_bringup import scene
from coglab_msgs.msg import DmpFeedback, MasterState
from coglab_perception.tf_listener import TfListener
from coglab_py import parameters, steady
from coglab_py.node_start import init_node
from visualization_msgs.msg import MarkerArray

PERIOD = 0.2  # s
SHOWN = ("running", "holding", "reached")  # states of a motion whose goal and path are drawn
SILENCE = 1.0  # s without feedback after which the controller counts as idle


class SceneMarkers:
    """Redraws five times a second from the newest frames and messages."""

    def __init__(self) -> None:
        self.library = cc.Library()
        self.library.load(parameters.read("coglab/dmp_library", str))
        length, width = parameters.numbers("~board_size", [0.40, 0.50], 2)
        self.board_size = (length, width)
        self.lock = threading.Lock()
        self.words = ""
        self.primitive = ""  # of the running motion
        self.start: np.ndarray | None = None  # its start, m in the base, (3,)
        self.heard = 0.0
        self.frames = tf2_ros.Buffer()
        self.listener = TfListener(self.frames, "world")
        self.publisher = rospy.Publisher("coglab/scene", MarkerArray, queue_size=1, latch=True)
        rospy.Subscriber("controller_manager/dmp/feedback", DmpFeedback, self.on_feedback, queue_size=10)
        rospy.Subscriber("coglab/state", MasterState, self.on_state, queue_size=1)

    def on_state(self, message: MasterState) -> None:
        """Text."""
        self.words = scene.words_of(message.state, message.object_id, message.why)

    def on_feedback(self, message: DmpFeedback) -> None:
        """Store the start of a motion, from its first feedback."""
        with self.lock:
            self.heard = time.monotonic()
            if message.state not in SHOWN:
                self.primitive, self.start = "", None
            elif self.primitive != message.primitive_id or self.start is None:
                self.primitive, self.start = message.primitive_id, self.place("ih2_palm")

    def place(self, frame: str) -> np.ndarray | None:
        """Newest position of a frame in the robot's base, m (3,); None if it is not known."""
        try:
            t = self.frames.lookup_transform(scene.BASE, frame, rospy.Time(0)).transform.translation
        except tf2_ros.TransformException:
            return None
        return np.array([t.x, t.y, t.z])

    def motion(self) -> list:
        """Goal and path of the running motion, or their removal."""
        with self.lock:
            fresh = time.monotonic() - self.heard < SILENCE
            primitive, start = (self.primitive, self.start) if fresh else ("", None)
        target = self.place("dmp_goal")
        if not primitive or start is None or target is None:
            return [scene.gone("goal"), scene.gone("path")]
        if primitive not in self.library.ids():
            return [scene.goal(target), scene.gone("path")]
        chosen = self.library[primitive]
        _, points, _ = cc.Dmp(chosen, position=start, goal=target).roll_out(target, 1.5 * chosen.duration, 0.02)
        return [scene.goal(target), scene.path(np.asarray(points))]

    def draw(self) -> None:
        """Publishes everything."""
        markers = [scene.pedestal(), *self.motion()]
        board = self.place("board")
        if board is not None:
            markers += scene.board(self.board_size, board[2])
        if self.words:
            markers.append(scene.text(self.words))
        self.publisher.publish(MarkerArray(markers))


def main() -> int:
    """Entry point."""
    init_node("scene_markers")
    markers = SceneMarkers()
    steady.SteadyTimer(PERIOD, markers.draw, "markers")
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
