"""A user's package, as an example: an action, a state and a delivery that machines.yaml names."""
