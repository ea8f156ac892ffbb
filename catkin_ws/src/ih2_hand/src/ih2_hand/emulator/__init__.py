"""A byte-exact stand-in for the IH2 Azzurra hand: motors, parser, faults, pty process."""
