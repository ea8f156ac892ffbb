"""./coglab film: an animated picture of a handover in both directions, rendered from the simulation without a screen.

The trial runs in virtual time, so the same seed gives the same film on every computer.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from coglab_sim._camera import Camera
from coglab_sim.person.body import arm_of
from coglab_trials import GIVE, RECEIVE, VirtualTrial, World
from coglab_trials.world import BOARD
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation

from coglab_bringup.arguments import film_parser
from coglab_bringup.usage import Refused

CAPTIONS = {RECEIVE: "The robot takes the mug from the person", GIVE: "The robot gives it back"}
SIZE = (560, 380)  # pixels
RATE = 12.0  # frames per second of virtual time
COLOURS = 96  # in the palette; fewer colours give a smaller file
LARGEST = 3e6  # bytes, limit of the file

LOOK_AT = [0.74, 0.0, 0.39]  # m, world: point in the centre of the picture
DISTANCE = 1.5  # m from the camera to LOOK_AT
AZIMUTH = -84.0  # degrees around z: direction in which the camera looks
ELEVATION = -12.0  # degrees; negative: the camera looks down

ORANGE, GREY, DARK = (0.93, 0.45, 0.10), (0.42, 0.44, 0.47), (0.15, 0.16, 0.18)
SKIN, SLEEVE, RED = (0.89, 0.69, 0.56), (0.45, 0.55, 0.66), (0.85, 0.12, 0.12)
FLOOR, WOOD = (0.86, 0.87, 0.88), (0.76, 0.63, 0.47)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Painter:
    """Draws the world of one trial. Create it in the thread that steps the world: the camera requires it."""

    def __init__(self, world: World, size: tuple[int, int] = SIZE) -> None:
        self.world = world
        self.camera = camera = Camera(world.cell, *size)
        camera.look(LOOK_AT, DISTANCE, AZIMUTH, ELEVATION)
        camera.set_colour("world", FLOOR)
        camera.set_colour("lwr_base_link", GREY)
        for number in range(1, 8):
            camera.set_colour(f"lwr_link_{number}", ORANGE if number < 7 else GREY)
        for body in ("ih2_base_link", *(name for name in world.cell.touch() if name != "palm")):
            camera.set_colour(body, DARK)
        camera.set_colour("object", RED)
        camera.set_colour("person_hand", SKIN, 0.0)  # invisible: a whole arm is drawn instead
        self._closed = 1.0

    def frame(self) -> Image.Image:
        """Picture of the current moment."""
        truth = self.world.cell.truth()
        for origin in self.world.robot.chain.joint_origins(truth["position"])[1:]:
            self.camera.add("sphere", [0.073, 0.0, 0.0], origin, UPRIGHT, GREY)
        self.camera.add("cylinder", [0.13, 0.37, 0.0], [0.0, 0.0, -0.37], UPRIGHT, GREY)
        self.camera.add("box", [0.252, 0.202, 0.022], BOARD.position - [0.0, 0.0, 0.02], UPRIGHT, WOOD)
        self._hand(truth)
        self._body(truth["human_hand"]["position"])
        return Image.fromarray(self.camera.draw())

    def _bone(self, start: np.ndarray, end: np.ndarray, radius: float, colour: Any) -> np.ndarray:
        """Draw a capsule between two points of the world (m). Returns `end`."""
        along = end - start
        tilt = np.arctan2(np.hypot(along[0], along[1]), along[2])
        turn = Rotation.from_euler("yz", [tilt, np.arctan2(along[1], along[0])])
        size = [radius, 0.5 * float(np.linalg.norm(along)), 0.0]
        self.camera.add("capsule", size, 0.5 * (start + end), turn.as_quat(), colour)
        return end

    def _hand(self, truth: Any) -> None:
        """Draw palm, fingers and thumb at the frame human_hand, whose x axis points to the person. The fingers close
        around the point 0.04 m in front of the palm."""
        position, turn = truth["human_hand"]["position"], Rotation.from_quat(truth["human_hand"]["rotation"])
        holds = truth["held_by"] in ("human", "both")
        self._closed += (float(holds) - self._closed) * 0.4  # the fingers need some frames to close or open
        curl = 0.35 + 1.15 * self._closed

        def world(x: float, y: float, z: float) -> np.ndarray:
            return position + turn.apply([x, y, z])

        palm = [0.020, 0.044, 0.046]
        self.camera.add("ellipsoid", palm, world(0.0, 0.0, 0.0), truth["human_hand"]["rotation"], SKIN)
        for z, length in ((0.036, 0.040), (0.012, 0.046), (-0.012, 0.044), (-0.035, 0.036)):
            tip, angle = (-0.006, 0.042), 0.15
            for part, radius in ((1.0, 0.0105), (0.85, 0.0100), (0.6, 0.0090)):
                start = world(*tip, z)
                tip = (tip[0] - part * length * np.cos(angle), tip[1] - part * length * np.sin(angle))
                self._bone(start, world(*tip, z), radius, SKIN)
                angle += 0.85 * curl
        tip, angle = (-0.002, -0.040), 0.1
        for length, radius in ((0.040, 0.0125), (0.034, 0.0115)):
            start = world(*tip, 0.012)
            tip = (tip[0] - length * np.cos(angle), tip[1] + length * np.sin(angle))
            self._bone(start, world(*tip, 0.012), radius, SKIN)
            angle += 0.7 * curl

    def _body(self, hand: np.ndarray) -> None:
        """Draw arm, trunk and head."""
        shoulder, elbow = arm_of(hand)
        wrist = hand + 0.09 * (elbow - hand) / np.linalg.norm(elbow - hand)
        self._bone(hand, wrist, 0.027, SKIN)
        self._bone(wrist, elbow, 0.037, SLEEVE)
        self._bone(elbow, shoulder, 0.046, SLEEVE)
        trunk, hips = shoulder + [0.05, -0.19, -0.06], shoulder + [0.06, -0.19, -0.50]
        self._bone(shoulder + [0.03, -0.03, 0.0], shoulder + [0.03, -0.35, 0.0], 0.065, SLEEVE)
        self._bone(trunk, hips, 0.135, SLEEVE)
        self._bone(hips, hips - [0.0, 0.0, 0.7], 0.12, DARK)
        self._bone(trunk, trunk + [0.0, 0.0, 0.16], 0.05, SKIN)
        self.camera.add("ellipsoid", [0.10, 0.08, 0.125], trunk + [-0.02, 0.0, 0.33], UPRIGHT, SKIN)
        self.camera.add("ellipsoid", [0.10, 0.084, 0.115], trunk + [0.02, 0.0, 0.355], UPRIGHT, DARK)  # hair
        elbow = self._bone(shoulder + [0.03, -0.38, 0.0], shoulder + [0.06, -0.42, -0.30], 0.046, SLEEVE)
        self._bone(elbow, elbow + [-0.05, 0.0, -0.26], 0.037, SLEEVE)


class Film:
    """Collects frames of a trial at RATE. Call `look` after each step of the world."""

    def __init__(self) -> None:
        self.frames: list[Image.Image] = []
        self._painter: Painter | None = None
        self._next = 0.0
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._font = ImageFont.truetype(str(fonts / "DejaVuSans.ttf"), 15)

    def look(self, trial: VirtualTrial) -> None:
        """Store a frame if one is due."""
        if not trial.begun:
            self._next = trial.world.t + 1.0 / RATE  # before the trial begins the arm moves home
            return
        if trial.world.t < self._next:
            return
        self._next += 1.0 / RATE
        self._painter = self._painter or Painter(trial.world)
        self.frames.append(self._with_caption(self._painter.frame(), trial))

    def _with_caption(self, frame: Image.Image, trial: VirtualTrial) -> Image.Image:
        draw = ImageDraw.Draw(frame)
        text = CAPTIONS[trial.begun[-1]]
        draw.rectangle([0, SIZE[1] - 28, SIZE[0], SIZE[1]], fill=(33, 37, 41))
        draw.text((10, SIZE[1] - 23), text, font=self._font, fill=(255, 255, 255))
        return frame

    def save(self, path: Path) -> int:
        """Write a GIF with one palette that repeats forever. Returns its size in bytes."""
        palette = self._palette()
        small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in self.frames]
        duration = round(1000.0 / RATE)
        small[0].save(path, save_all=True, append_images=small[1:], duration=duration, loop=0, optimize=False)
        return path.stat().st_size

    def _palette(self) -> Image.Image:
        """A palette of COLOURS colours for all frames, computed from eight of them."""
        chosen = self.frames[:: max(1, len(self.frames) // 8)][:8]
        sheet = Image.new("RGB", (SIZE[0], SIZE[1] * len(chosen)))
        for row, frame in enumerate(chosen):
            sheet.paste(frame, (0, row * SIZE[1]))
        return sheet.quantize(COLOURS, method=Image.Quantize.FASTOCTREE)


def main(words: list[str]) -> int:
    """Exit status 0: the film is written and both handovers succeeded; 1: otherwise; 2: invalid arguments."""
    try:
        options = film_parser(Path(os.environ["COGLAB_TOP"])).parse_args(words)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    begun, film = time.monotonic(), Film()
    trial = VirtualTrial(seed=options.seed)
    trial.beside = film.look
    print(f"[coglab] drawing a handover in both directions, seed {options.seed}: about a minute", flush=True)
    try:
        results = trial.run(RECEIVE, GIVE)
    except (TimeoutError, RuntimeError) as error:  # the machine is stuck, or nothing can draw without a screen
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 1
    for result in results:
        print(f"[coglab] {result.action}: {result.outcome}")
    if not film.frames:
        print("[coglab] error: the first action never began, so there is nothing to show", file=sys.stderr)
        return 1
    size = film.save(options.out)
    print(
        f"[coglab] {options.out}: {len(film.frames)} frames, {len(film.frames) / RATE:.0f} s, {size / 1e6:.1f} MB, "
        f"drawn in {time.monotonic() - begun:.0f} s"
    )
    if size > LARGEST:
        print(f"[coglab] note: larger than {LARGEST / 1e6:.0f} MB; another seed may give a shorter film")
    return 0 if [result.outcome for result in results] == ["succeeded", "succeeded"] else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
