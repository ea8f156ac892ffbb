"""The simulated person: character, perception and motion of the hand."""
