"""The tf2 frames by role. Their names are defined only in config/frames.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from coglab_py.yaml_file import YamlError, read

AHEAD = "_ahead"
"""suffix of the frame at the predicted place of a tracked frame at the handover"""
CLOCK_TOLERANCE = 0.05
"""s, largest difference of synchronised clocks: a later stamp is from the future, and is refused"""


class FramesError(ValueError):
    """The file or parameter of the frames is invalid; the message states the error."""


@dataclass(frozen=True)
class FrameNames:
    """Names of the frames. `object` contains {id}, which stands for the object's id in the database.

    Example::

        frames = FrameNames.from_mapping(parameters.read("perception/frames", dict, {}))
        frames.object_frame("mug")          # "object_mug"
    """

    world: str
    human_hand: str
    board: str
    object: str

    def object_frame(self, object_id: str) -> str:
        """Frame of an object of the database."""
        return self.object.replace("{id}", object_id)

    def object_id(self, frame: str) -> str:
        """Id of the object that has this tracked frame; empty for every other frame."""
        before, _, after = self.object.partition("{id}")
        if frame.endswith(AHEAD) or not (frame.startswith(before) and frame.endswith(after)):
            return ""
        return frame[len(before) : len(frame) - len(after)]

    def is_tracked(self, frame: str) -> bool:
        """True if a tracker publishes this frame: the partner's hand or an object."""
        return frame == self.human_hand or self.object_id(frame) != ""

    @staticmethod
    def from_mapping(data: Any, source: str = "perception/frames") -> FrameNames:
        """Names from the parameter or any mapping. A FramesError names the missing, unknown or empty role."""
        roles = [f.name for f in fields(FrameNames)]
        if not isinstance(data, Mapping):
            raise FramesError(
                f"{source}: expected a mapping with {', '.join(roles)}: load coglab_perception/config/frames.yaml there"
            )
        missing = [role for role in roles if not (isinstance(data.get(role), str) and data[role])]
        unknown = sorted(set(map(str, data)) - set(roles))
        if missing or unknown:
            raise FramesError(
                f"{source}: missing: {', '.join(missing) or 'none'}; unknown: "
                f"{', '.join(unknown) or 'none'}; expected {', '.join(roles)}, "
                "as in coglab_perception/config/frames.yaml"
            )
        if "{id}" not in data["object"]:
            raise FramesError(f"{source}: object is '{data['object']}'; it must contain {{id}}")
        names = [data[role] for role in roles]
        slashed = [name for name in names if name.startswith("/")]
        if slashed or len(set(names)) < len(names):
            raise FramesError(
                f"{source}: tf2 frames differ from each other and have no leading slash; got {', '.join(names)}"
            )
        return FrameNames(**{role: data[role] for role in roles})

    @staticmethod
    def load(path: str) -> FrameNames:
        """Names from a YAML file. A FramesError names file and line."""
        try:
            return FrameNames.from_mapping(read(path).value, path)
        except YamlError as error:
            raise FramesError(str(error)) from None
