"""A moving picture of a recorded trial, drawn from its measurements and the model of the cell, without a screen."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from coglab_tools.command import CheckFailed, NotThere, progress
from coglab_tools.files import write_by
from coglab_tools.trial.read import Measured

RATE = 12.5  # frames per second; a GIF shows each for whole hundredths of a second
BEFORE = 0.5  # s drawn before the action
LONGEST = 120.0  # s of a trial that are drawn
COLOURS = 96  # of a GIF
KINDS = (".gif", ".mp4")
STROKE = 254.0  # counts of a finger's motor from open to closed
FAR = (0.0, 0.0, -5.0)  # m, outside the picture, for unseen objects
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
FFMPEG_LIMIT = 300.0  # s


class _World:
    """The recorded trial in the form of a virtual world, for Painter."""

    def __init__(self, trial: Measured) -> None:
        import coglab_controllers as cc
        from coglab_objects.database import cell_parameters, objects_folder, read_object
        from coglab_py.packages import package_path
        from coglab_sim import _cell

        urdf = package_path("lwr_description", "urdf", "lwr_ih2.urdf")
        parameters: dict[str, Any] = {"object/start": "world", "object/position": [0.8, 0.0, 0.4]}
        file = objects_folder() / f"{trial.record.object}.yaml"
        if trial.record.object and file.is_file():
            parameters.update({f"object/{k}": v for k, v in cell_parameters(read_object(file)[0]).items()})
        self.solids = _cell.Cell(str(urdf), parameters)
        self.cell = self
        self.robot = SimpleNamespace(chain=cc.Chain(urdf.read_text(encoding="utf-8")))
        self._truth: dict[str, Any] = {}
        self._joints = _table(trial.series.joints, 1)
        self._fingers = _table(trial.series.fingers, 1)
        self._hands = _table(trial.series.truth, 2)
        self._object = _table(trial.series.truth, 3)
        self._turns = _table([(t, [*a, *b]) for t, a, b in trial.orientations], 1)

    def touch(self) -> Any:
        """Names of the phalanges, as the cell's touch() has them."""
        return self.solids.touch()

    def truth(self) -> dict[str, Any]:
        """State at the time of the last `move`, in the form of the cell's truth()."""
        return self._truth

    def move(self, camera: Any, now: float) -> None:
        """Move everything to its recorded place at a time (s)."""
        joints, fingers = _at(self._joints, now), _at(self._fingers, now)
        thing, hand, turns = _at(self._object, now), _at(self._hands, now), _at(self._turns, now)
        person_turn, thing_turn = (turns[:4], turns[4:]) if turns is not None else (UPRIGHT, UPRIGHT)
        place = thing if thing is not None and np.isfinite(thing).all() else np.array(FAR)
        share = np.zeros(5) if fingers is None else np.clip(fingers / STROKE, 0.0, 1.0)
        camera.pose(joints, list(share), place, thing_turn)
        seen = hand is not None and np.isfinite(hand).all()
        held = hand is not None and seen and float(np.linalg.norm(hand - place)) < 0.12
        self._truth = {
            "position": joints,
            "human_hand": {"position": hand if seen else np.array([0.0, 3.0, 0.0]), "rotation": np.array(person_turn)},
            "held_by": "human" if held else "robot",
        }


def _table(rows: list[Any], column: int) -> tuple[np.ndarray, np.ndarray] | None:
    if not rows:
        return None
    return np.array([row[0] for row in rows], dtype=float), np.array([row[column] for row in rows], dtype=float)


def _at(table: tuple[np.ndarray, np.ndarray] | None, now: float) -> np.ndarray | None:
    """The newest row at a time; the first one before it."""
    if table is None:
        return None
    row: np.ndarray = table[1][max(0, int(np.searchsorted(table[0], now, side="right")) - 1)]
    return row


def write_video(trial: Measured, file: Path) -> dict[str, float]:
    """Draw a trial into a GIF, or an MP4 with ffmpeg. Returns `frames` and `seconds`. NotThere: the camera or ffmpeg is
    missing. CheckFailed: the trial has no joint positions, or nothing can draw here."""
    moving = file.suffix.lower() == ".mp4"
    if moving and shutil.which("ffmpeg") is None:
        raise NotThere("an .mp4 needs ffmpeg: sudo apt install ffmpeg; a .gif does not")
    if not trial.series.joints:
        raise CheckFailed(
            f"the trial {trial.record.id} has no joint positions (lwr/joint_states), so there is nothing to draw"
        )
    try:
        from coglab_tools.trial.painter import Painter
    except ImportError as error:
        raise NotThere(f"the camera is not built ({error}); ./coglab trial video builds it") from None

    world: Any = _World(trial)
    at_first: Any = SimpleNamespace(cell=world.solids, robot=world.robot)
    try:
        painter = Painter(at_first)
    except RuntimeError as error:
        raise CheckFailed(f"nothing can be drawn here: {error}") from None
    painter.world = world
    times = np.arange(trial.start - BEFORE, min(trial.end, trial.start + LONGEST), 1.0 / RATE)

    def frame(now: float) -> Any:
        world.move(painter.camera, now)
        return _with_caption(painter.frame(), trial, now)

    frames = (frame(float(now)) for now in progress(times, len(times), "drawing"))
    if moving:
        write_by(file, lambda part: _mp4(frames, frame(float(times[0])).size, part))
    else:
        palette = frame(float(times[len(times) // 2])).quantize(COLOURS)
        write_by(file, lambda part: _gif(frames, palette, part))
    return {"frames": len(times), "seconds": len(times) / RATE}


def _with_caption(frame: Any, trial: Measured, now: float) -> Any:
    """The picture with the time since the action began, the action and the last event."""
    from PIL import ImageDraw, ImageFont

    parts = trial.parts()
    part = next((each for each in reversed(parts) if each.start <= now), parts[0])
    passed = [mark for mark in part.record.marks if mark["time_s"] <= now - part.start]
    event = max(passed, key=lambda mark: mark["time_s"])["name"] if passed else ""
    words = f"{now - part.start:+6.2f} s   {part.record.action}   {event}".replace("_", " ")
    draw, (width, height) = ImageDraw.Draw(frame), frame.size
    draw.rectangle([0, height - 24, width, height], fill=(33, 37, 41))
    draw.text((10, height - 19), words, font=ImageFont.load_default(), fill=(255, 255, 255))
    return frame


def _gif(frames: Iterator[Any], palette: Any, file: Path) -> None:
    small = [frame.quantize(palette=palette, dither=0) for frame in frames]
    small[0].save(file, save_all=True, append_images=small[1:], duration=round(1000.0 / RATE), loop=0)


def _mp4(frames: Iterator[Any], size: tuple[int, int], file: Path) -> None:
    command = ["ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}"]
    command += ["-r", f"{RATE:g}", "-i", "-", "-pix_fmt", "yuv420p", "-y", str(file)]
    with tempfile.TemporaryFile() as errors:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=errors) as process:
            assert process.stdin is not None
            with suppress(BrokenPipeError):  # it ended early with a message
                for frame in frames:
                    process.stdin.write(frame.convert("RGB").tobytes())
                process.stdin.close()
            status = process.wait(FFMPEG_LIMIT)
        if status:
            errors.seek(0)
            said = errors.read().decode(errors="replace").strip().splitlines() or ["it printed no message"]
            raise CheckFailed(f"ffmpeg could not make {file.name}: {said[-1]}")
