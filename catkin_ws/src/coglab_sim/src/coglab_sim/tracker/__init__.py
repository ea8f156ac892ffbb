"""The simulated tracker: what perception delivers of the cell."""
