"""An actionlib server for nodes that run for days, on computers whose clock may step."""

from __future__ import annotations

from typing import Any

import actionlib
import rospy
from actionlib_msgs.msg import GoalID

from coglab_py.steady import SteadyTimer


class ActionServer(actionlib.ActionServer):
    """An action server that keeps accepting goals after any cancel and any step of the clock.

    actionlib refuses every goal that is older than the newest stamp of a cancel request: after one
    request with a stamp of the year 2106 it accepts no goal any more. Its timer publishes no status
    while /clock stands still, and ends when /clock steps back.
    """

    last_cancel: Any

    @property
    def status_frequency(self) -> float:
        """0, so that actionlib creates no timer."""
        return 0.0

    @status_frequency.setter
    def status_frequency(self, frequency: float) -> None:
        self._frequency = frequency

    def initialize(self) -> None:
        super().initialize()
        if self._frequency > 0.0:
            period = 1.0 / self._frequency
            self.status_timer = SteadyTimer(period, lambda: self.publish_status_async(None), "action_status")

    def internal_goal_callback(self, goal: Any) -> None:
        if self.last_cancel > rospy.Time.now():  # the clock stepped back
            self.last_cancel = rospy.Time()
        super().internal_goal_callback(goal)

    def internal_cancel_callback(self, goal_id: GoalID) -> None:
        goal_id.stamp = min(goal_id.stamp, rospy.Time.now())
        super().internal_cancel_callback(goal_id)
