"""The interface of perception to the rest of the system, and recognition of the partner's reaching motion."""
