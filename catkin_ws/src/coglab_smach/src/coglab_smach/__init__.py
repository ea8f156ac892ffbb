"""High-level cognitive controller of CogLab: the state machines.

Packages from bottom to top; each imports only the ones before it: clocks, kinematics, ports, context, states, machines,
ros. Only ros imports a ROS client library; the states use ports.
"""
