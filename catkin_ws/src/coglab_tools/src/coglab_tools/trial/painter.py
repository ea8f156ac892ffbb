"""Draws the cell and the person with the camera of the simulation, without a screen."""

from __future__ import annotations

from typing import Any

import numpy as np
from coglab_sim._camera import Camera
from coglab_sim.person.body import arm_of
from coglab_trials import World
from coglab_trials.world import BOARD
from PIL import Image
from scipy.spatial.transform import Rotation

SIZE = (560, 380)  # pixels
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
