"""The simulated tracker: observations of the cell with the errors of perception."""
