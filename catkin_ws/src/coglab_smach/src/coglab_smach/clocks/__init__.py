"""Clocks of the states, for measuring time and waiting. The virtual clock is in coglab_trials."""
