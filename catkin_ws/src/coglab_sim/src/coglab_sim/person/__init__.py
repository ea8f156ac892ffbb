"""The simulated person: who they are, what they perceive, what their hand does."""
