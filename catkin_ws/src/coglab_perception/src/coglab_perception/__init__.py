"""What the rest of the system may expect from perception, and recognition of the partner's reaching motion."""
