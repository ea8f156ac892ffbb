"""A stand-in of rospy.Subscriber for tests without a ROS master."""

import threading


class Topics:
    """Takes the place of the class rospy.Subscriber. `send` delivers a message to the subscriber of a topic."""

    def __init__(self):
        self._callbacks, self._changed = {}, threading.Condition()

    def __call__(self, topic, kind, callback, *arguments, **_options):
        with self._changed:
            self._callbacks[topic] = lambda message: callback(message, *arguments)
            self._changed.notify_all()
        return self

    def get_num_connections(self):
        return 1

    def unregister(self):
        pass

    def wait(self, topic, limit):
        """Wait until the topic is subscribed, `limit` s at most. True if it is."""
        with self._changed:
            return self._changed.wait_for(lambda: topic in self._callbacks, limit)

    def send(self, topic, message):
        self._callbacks[topic](message)
