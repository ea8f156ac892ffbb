"""Studies: participants, conditions, trials and questionnaires."""
