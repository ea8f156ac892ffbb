"""Interfaces of the state machines to the rest of the system, and answers that take time."""
