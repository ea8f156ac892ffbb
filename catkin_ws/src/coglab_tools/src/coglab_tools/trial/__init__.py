"""Recorded handovers: what was recorded, and what it shows."""
