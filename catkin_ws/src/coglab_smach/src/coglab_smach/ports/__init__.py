"""What the machines need from the rest of the system: interfaces, and answers that take time."""
