"""Objects that every state receives: configuration, journal, triggers, memory."""
