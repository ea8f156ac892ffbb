"""Id of the object in the robot's hand: in memory, and in a small file that survives a restart of the node.

The file counts only if the hand itself reports a grip: see WhatIsHeld.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable

UNKNOWN = "unknown"  # id of a held object whose name is not known


class HoldingMemory:
    """One object id on disk; an empty id means an empty hand. Written at each change, read at start."""

    def __init__(self, path: str = "", warn: Callable[[str], None] | None = None) -> None:
        self.path = path
        self._warn = warn or (lambda text: None)

    def recall(self) -> str:
        """Returns the last noted id; empty if there is none or the file cannot be read."""
        if not self.path or not os.path.exists(self.path):
            return ""
        try:
            with open(self.path, encoding="utf-8") as stream:
                return str(json.load(stream)["object_id"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            self._warn(f"{self.path} cannot be read ({error}): which object the hand holds is not known")
            return ""

    def note(self, object_id: str) -> None:
        """Store this id. Replaces the file in one step."""
        if not self.path:
            return
        try:
            os.makedirs(os.path.dirname(os.path.abspath(self.path)), exist_ok=True)
            beside = f"{self.path}.new"
            with open(beside, "w", encoding="utf-8") as stream:
                json.dump({"object_id": object_id}, stream)
            os.replace(beside, self.path)
        except OSError as error:
            self._warn(
                f"{self.path} cannot be written ({error.strerror}): after a restart the held object will be unknown"
            )
