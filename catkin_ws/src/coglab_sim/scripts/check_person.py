#!/usr/bin/python3
"""check_person.py BEHAVIOUR PROFILE RECORDING WAY OBJECT SOURCE: checks the settings of the virtual person.

For launch files (<param command=...>): without it the launch would start a person that cannot run again and again.
Prints "usable", or writes one sentence per unusable setting to stderr and exits with 1.
"""

from __future__ import annotations

import sys

from coglab_sim.person.participant import BEHAVIOURS, PROFILES

SHIPPED = "mug"  # object of config/cell.yaml, used by a launch without an object


def complaints(behaviour: str, profile: str, recording: str, way: str, object_id: str, source: str) -> list[str]:
    """Returns one sentence per setting that cannot be used. ``object_id``: object in the person's hand, empty for the
    shipped one. ``source``: its source in a recording, see open_recorded_hand."""
    judged = [("behaviour", behaviour, BEHAVIOURS), ("profile", profile, PROFILES)]
    unreadable = []
    if recording or way != "wait":  # slow imports, for recordings only
        from coglab_sim.person.recorded_person import WAYS, open_recorded_hand

        judged.append(("recorded_person", way, WAYS))
        try:
            if recording and way in WAYS:
                settings = {"file": recording, "person": way, "object": source}
                open_recorded_hand(settings, f"object_{object_id or SHIPPED}")
        except (OSError, ValueError) as error:
            unreadable.append(f"recording:={recording}: {error}")
    return [
        f"{name}:={value}: there is no '{value}'; there are: {', '.join(known)}"
        for name, value, known in judged
        if value not in known
    ] + unreadable


def main(words: list[str]) -> int:
    """Returns the exit status: 0 usable, 1 not usable, 2 wrong usage."""
    if len(words) != 6:
        print(__doc__, file=sys.stderr)
        return 2
    found = complaints(*words)
    for sentence in found:
        print(f"the virtual person cannot start: {sentence}", file=sys.stderr)
    if not found:
        sys.stdout.write("usable")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
