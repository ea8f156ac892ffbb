"""High-level cognitive controller of CogLab: state machines and contact detection.

Packages from the bottom up, each of which imports only those before it: clocks, kinematics, ports, contact, context,
states, machines, simulated, ros. None but ros imports a ROS client library: states talk to ports.
"""
