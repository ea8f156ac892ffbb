"""Names of actions that several packages use. Standard library only, as `./coglab start` needs no build."""

WAYS_OUT = ("reset", "initialise")
"""Actions that lead out of the states stopped and fault. They end in the next hub and leave no record."""
SHORT_NAMES = {"receive": "exchange_human_to_robot", "give": "exchange_robot_to_human"}
"""Short names of actions in a trigger."""
