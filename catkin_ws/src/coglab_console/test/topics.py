"""A stand-in of rospy.Subscriber for tests without a ROS master."""


class Topics:
    """Takes the place of the class rospy.Subscriber. `send` delivers a message to the subscriber of a topic."""

    def __init__(self):
        self._callbacks = {}

    def __call__(self, topic, kind, callback, *arguments, **_options):
        self._callbacks[topic] = lambda message: callback(message, *arguments)
        return self

    def get_num_connections(self):
        return 1

    def send(self, topic, message):
        self._callbacks[topic](message)
