"""./coglab film: an animated picture of a handover in both directions, rendered from the simulation without a screen.

The trial runs in virtual time, so the same seed gives the same film on every computer.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import matplotlib
from coglab_tools.trial.painter import SIZE, Painter
from coglab_trials import GIVE, RECEIVE, VirtualTrial
from PIL import Image, ImageDraw, ImageFont

from coglab_bringup.arguments import film_parser
from coglab_bringup.usage import Refused

CAPTIONS = {RECEIVE: "The robot takes the mug from the person", GIVE: "The robot gives it back"}
RATE = 12.0  # frames per second of virtual time
COLOURS = 96  # in the palette; fewer colours give a smaller file
LARGEST = 3e6  # bytes, limit of the file


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
