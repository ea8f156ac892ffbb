"""Fixed splits of drawn people: train, validation, test. The same person is never in two of the first three."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coglab_trials.conditions import HARDSHIPS, Conditions, hardship

OBJECTS = ("mug", "bottle", "ball", "tea_box", "screwdriver")


@dataclass(frozen=True)
class Split:
    """People of one split. ``seeds``: one for each person. ``hard``: every person meets one hardship of
    coglab_trials.conditions.HARDSHIPS, in turn: less trust, tilt, bias, mass, friction or latency."""

    name: str
    seeds: range
    hard: bool = False

    def conditions(self, seed: int, objects: Sequence[str]) -> Conditions:
        """Conditions of this person: the object is one of ``objects``, in turn. ValueError: an unknown object."""
        for one in objects:
            if one not in OBJECTS:
                raise ValueError(f"object '{one}' is none of {', '.join(OBJECTS)}")
        if not objects:
            raise ValueError(f"objects is empty; expected some of {', '.join(OBJECTS)}")
        plain = Conditions(object_id=objects[seed % len(objects)])
        # Independent of the objects: each object meets all hardships.
        return hardship(list(HARDSHIPS)[seed // len(OBJECTS) % len(HARDSHIPS)], seed, plain) if self.hard else plain


SPLITS = {
    split.name: split
    for split in (
        Split("train", range(1_000_000, 2_000_000)),
        Split("validation", range(2_000_000, 2_001_000)),
        Split("test", range(3_000_000, 3_000_300)),
        Split("test_hard", range(3_000_000, 3_000_300), hard=True),
    )
}


def split_named(name: str) -> Split:
    """Returns a split. ValueError: another name."""
    if name not in SPLITS:
        raise ValueError(f"split '{name}' is none of {', '.join(SPLITS)}")
    return SPLITS[name]
