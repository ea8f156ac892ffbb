"""A user's delivery, for every object.

machines.yaml::

    deliveries:
      low: my_lab.deliveries:low
"""


def low(entry, hand):
    """The object's default delivery, but 2 cm lower in the person's hand.

    ``entry``: the object's file as a dict. ``hand``: Pose of the person's hand in the base frame, as it is seen now.
    """
    shipped = entry["deliveries"][entry["default_delivery"]]
    x, y, z = shipped["pose"]["xyz"]
    return {"pose": {"xyz": [x, y, z - 0.02], "rpy_deg": [0, 0, 0]}, "release": shipped["release"]}
