"""The simulated cell of CogLab: it replaces robot and people behind the wire protocols."""
