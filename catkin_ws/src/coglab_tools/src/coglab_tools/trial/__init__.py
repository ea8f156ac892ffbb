"""Recorded handovers: recording, reading and showing them."""
