"""Where the arm can reach, how long it may take, and where the palm has to go."""
