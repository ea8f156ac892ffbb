#!/usr/bin/python3
"""check_person.py BEHAVIOUR PROFILE RECORDING WAY OBJECT SOURCE: whether the virtual person can use these settings.

For launch files (<param command=...>), which would otherwise start a person again and again who cannot begin. Prints
"usable", or ends with 1 and one sentence per setting on the error output.
"""

from __future__ import annotations

import sys

from coglab_sim.person.participant import BEHAVIOURS, PROFILES

SHIPPED = "mug"
"""object of config/cell.yaml, which a launch without one takes"""


def complaints(behaviour: str, profile: str, recording: str, way: str, object_id: str, source: str) -> list[str]:
    """What cannot be used, and what there is. ``object_id``: that the person holds, empty for the shipped one;
    ``source``: where it comes from in a recording, see open_recorded_hand."""
    judged = [("behaviour", behaviour, BEHAVIOURS), ("profile", profile, PROFILES)]
    unreadable = []
    if recording or way != "wait":  # what reads recordings takes long to import
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
    """Exit status: 0 usable, 1 not, 2 usage."""
    if len(words) != 6:
        print(__doc__, file=sys.stderr)
        return 2
    found = complaints(*words)
    for sentence in found:
        print(f"the virtual person cannot begin: {sentence}", file=sys.stderr)
    if not found:
        sys.stdout.write("usable")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
