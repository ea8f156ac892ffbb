"""The simulated cell of CogLab: what answers behind the wires when no robot is there."""
