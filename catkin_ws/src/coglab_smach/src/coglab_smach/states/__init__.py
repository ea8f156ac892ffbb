"""Leaf states of the machines. Each does one thing through a port and ends within its time limit."""
