"""Ports without ROS: a kinematic cell in which the machines run in virtual time."""
