"""A goal toward where a mug will be, and the region that its reach may not leave, for tests of reaches."""

LOW, HIGH = [-1.0, -1.0, -1.0], [2.0, 1.0, 2.0]
REGION = {"handover.region_low": LOW, "handover.region_high": HIGH}
IDENTITY = (0.0, 0.0, 0.0, 1.0)
GOAL = {
    "frame": "object_mug_ahead",
    "offset": [0.0, 0.0, 0.1],
    "orientation": list(IDENTITY),
    "primitive": "reach_human",
    "dmp_ratio": 1.5,
    "limits": {"goal_retreat": 0.0, "goal_drop": 0.0, "goal_region_low": LOW, "goal_region_high": HIGH},
    "watch": {"retreat": 0.10, "drop": 0.08, "margin": 0.0},
}
