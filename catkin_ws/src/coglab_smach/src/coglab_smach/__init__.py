"""High-level cognitive controller of CogLab: state machines, object database, contact detection.

The core (everything but ``ros_ports`` and the scripts) imports no ROS client library: states talk to ports.
"""
