"""High-level cognitive controller of CogLab: state machines, object database, contact detection.

The core (everything but the modules ``ros_*`` and the scripts) imports no ROS client library: states talk to ports.
"""
