"""What is drawn: the robot, the path ahead, primitives, graphs of state machines."""
