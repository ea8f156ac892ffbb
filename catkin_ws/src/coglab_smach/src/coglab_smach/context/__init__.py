"""What every state is given: configuration, journal, triggers, memory."""
