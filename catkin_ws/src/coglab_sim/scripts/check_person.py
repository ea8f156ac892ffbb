#!/usr/bin/python3
"""check_person.py BEHAVIOUR PROFILE RECORDING WAY: whether these settings of the virtual person can be used.

For launch files (<param command=...>), which would otherwise start a person again and again who cannot begin. Prints
"usable", or ends with 1 and one sentence per setting on the error output.
"""

from __future__ import annotations

import sys

from coglab_sim.person.participant import BEHAVIOURS, PROFILES


def complaints(behaviour: str, profile: str, recording: str, way: str) -> list[str]:
    """What cannot be used, and what there is."""
    judged = [("behaviour", behaviour, BEHAVIOURS), ("profile", profile, PROFILES)]
    unreadable = []
    if recording or way != "wait":  # what reads recordings takes long to import
        from coglab_sim.person.recorded_motion import load_recording
        from coglab_sim.person.recorded_person import WAYS

        judged.append(("recorded_person", way, WAYS))
        try:
            if recording:
                load_recording(recording)
        except (OSError, ValueError) as error:
            unreadable.append(f"recording:={recording}: {error}")
    return [
        f"{name}:={value}: there is no '{value}'; there are: {', '.join(known)}"
        for name, value, known in judged
        if value not in known
    ] + unreadable


def main(words: list[str]) -> int:
    """Exit status: 0 usable, 1 not, 2 usage."""
    if len(words) != 4:
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
