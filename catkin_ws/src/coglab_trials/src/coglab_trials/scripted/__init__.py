"""Ports without ROS and without physics: a kinematic cell in which the machines run in virtual time."""
