"""The rospy nodes of the cell without a master: parameters from a dictionary, publications and log lines in lists."""

import importlib.util
import time
from pathlib import Path

import rospy
import tf2_ros
from coglab_py import steady

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


def script(name):
    """The module of a script."""
    spec = importlib.util.spec_from_file_location(f"{name}_script", SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class RosDouble:
    """Replaces ROS for a node. ``parameters``: values by the requested name."""

    def __init__(self, monkeypatch, **parameters):
        self.parameters = {name.replace("__", "/"): value for name, value in parameters.items()}
        self.published, self.subscribed, self.services, self.said = {}, {}, {}, []
        self.made, self.timers, self.sent, self.static = {}, [], [], []
        self.now, self.boot = 5.0, 100.0
        monkeypatch.setattr(rospy, "get_param", lambda name, default=None: self.parameters.get(name, default))
        monkeypatch.setattr(rospy, "has_param", lambda name: name in self.parameters)
        monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
        monkeypatch.setattr(rospy, "get_namespace", lambda: "/a/coglab_sim/")
        monkeypatch.setattr(rospy, "get_time", lambda: self.now)
        monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time.from_sec(self.now))
        monkeypatch.setattr(rospy, "Publisher", self.publisher)
        monkeypatch.setattr(rospy, "Subscriber", lambda name, kind, call, **_: self.subscribed.update({name: call}))
        monkeypatch.setattr(rospy, "Service", lambda name, kind, call: self.services.update({name: call}))
        monkeypatch.setattr(time, "monotonic", lambda: self.now + self.boot)
        monkeypatch.setattr(steady, "SteadyTimer", lambda period, call, name: self.timers.append((period, call)))
        for level in ("loginfo", "logwarn", "logfatal"):
            monkeypatch.setattr(rospy, level, lambda text, *values: self.said.append(text % values))
        monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: self.said.append(text))
        monkeypatch.setattr(tf2_ros, "TransformBroadcaster", lambda: Sending(self.sent))
        monkeypatch.setattr(tf2_ros, "StaticTransformBroadcaster", lambda: Sending(self.static))

    def publisher(self, name, kind, **options):
        self.made[name] = options
        return Publishing(self.published.setdefault(name, []))


class Publishing:
    """Double of a publisher."""

    def __init__(self, messages):
        self.publish = messages.append


class Sending:
    """Double of a broadcaster."""

    def __init__(self, messages):
        self.sendTransform = messages.append
