"""Data for the drawings: robot, path of the next motion, primitives, graphs of state machines."""
