"""Reachability and motion time of the arm, and goals of the palm."""
