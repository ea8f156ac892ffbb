"""Leaf states of the machines; each does one thing through a port and ends within its time limit."""
