"""The environments ``coglab/Receive-v0`` and ``coglab/Give-v0``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from coglab_py.pose import Pose, length
from coglab_sim.person.in_cell import pose_of_truth
from coglab_trials.world import DT
from gymnasium import spaces

from coglab.envs.people import split_named
from coglab.envs.referee import GIVE, RECEIVE, Referee
from coglab.envs.stage import Stage
from coglab.values import finite, number

RATE = 20.0  # Hz of actions
PERIODS = round(1.0 / (RATE * DT))  # of the world in one step
SPEED = 0.6  # m/s, speed of the palm along an axis at an action of 1
TURNING = 1.5  # rad/s, the same about an axis
CONTROLS = {"palm_twist": "twist_stream", "joint_velocity": "joint_velocity_stream"}
OLDEST = 10.0  # s, largest age; also the age of an object that was never seen
FARTHEST = 3.0  # m, bound of positions in observations
STRONGEST = 100.0  # Nm, bound of torques in observations


@dataclass(frozen=True)
class Reward:
    """Weights of the reward. Each step adds ``progress`` times the approach (m) of the palm to the true place of the
    handover, until the first touch. It subtracts ``time`` per s, and ``force`` per N s above 5 N on the person. The end
    adds ``success``, or subtracts ``failure`` if the object falls, the person gives up or the arm stops."""

    success: float = 1.0
    failure: float = 1.0
    progress: float = 0.5
    time: float = 0.02
    force: float = 0.05


class HandoverEnv(gymnasium.Env):
    """A person gives an object to the robot, or takes one from it. One step is 50 ms. The arm keeps all its limits
    for any action.

    ``split``: people of "train", "validation", "test" or "test_hard" (coglab.envs.SPLITS). ``objects``: ids of the
    objects, in turn over the people. ``control``: "palm_twist" or "joint_velocity". ``time_limit``: s until the episode
    is truncated. ``reward``: weights. ``render_mode``: None or "rgb_array". ValueError: anything else.

    Action, float32 in -1..1 (values outside count as the bound): with "palm_twist" (7,): velocity of the palm in the
    base frame as share of 0.6 m/s (3) and 1.5 rad/s (3), then the hand: above 0 close, below 0 open, 0 as before. With
    "joint_velocity" (8,): velocities as shares of the joints' limits (7), then the hand.

    Observation, a dict: ``joints`` rad and ``joint_velocity`` rad/s as measured (7,), ``palm`` (7,), ``fingers`` 0 open
    to 1 closed (5,), ``holding`` 1 if the hand's motors show an object (1,), ``human_hand`` and ``object`` as the
    tracker saw them last (7,) with ``human_hand_age`` and ``object_age`` s (1,), ``goal`` (7,): pose of the palm at the
    handover in the frame of the object (Receive) or of the person's hand (Give), ``external_torque`` Nm as the arm
    estimates it (7,), ``phase`` of the robot's hand: 0 open, 1 closing, 2 closed, 3 opening; ``time`` s (1,). Poses:
    position m and quaternion x y z w in the base frame. An object or hand that was never seen has the age 10 s.

    Info: ``success``, ``time`` s until the receiver held the object alone (infinite without success), ``force`` N,
    largest on the person, ``dropped``, ``gave_up``, ``stopped``: reason why the arm does not follow (empty if it does),
    ``person`` (seed), ``object``, ``reward``: its parts. The first five are true values, not part of an observation.

    The robot speaks by itself, like the shipped machines: it asks the person at the start, and says "I have it"
    or "You have it" once its hand has closed on the object or has opened.

    ``reset(seed=...)`` draws a person of the split; ``reset(options={"person": 7})`` takes the eighth one. The same
    seed and actions give the same episode, bit for bit.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": RATE}
    task = RECEIVE

    def __init__(
        self,
        split: str = "train",
        objects: Sequence[str] = ("mug",),
        control: str = "palm_twist",
        time_limit: float = 20.0,
        reward: Reward = Reward(),
        render_mode: str | None = None,
    ) -> None:
        self.split = split_named(split)
        self.objects = (objects,) if isinstance(objects, str) else tuple(objects)
        self.split.conditions(self.split.seeds[0], self.objects)  # raises for unknown objects
        if control not in CONTROLS:
            raise ValueError(f"control '{control}' is none of {', '.join(CONTROLS)}")
        if number(time_limit, "time_limit", "s", 0.0) > 600.0:
            raise ValueError(f"time_limit: at most 600 s is expected, got {time_limit!r}")
        if not isinstance(reward, Reward):
            raise ValueError(f"reward: a coglab.envs.handover.Reward is expected, got {reward!r}")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode '{render_mode}' is none of None, rgb_array")
        self.control, self.time_limit, self.weights, self.render_mode = control, time_limit, reward, render_mode
        self._camera_type = _camera_type() if render_mode else None
        self._camera: Any = None
        self._stage: Stage | None = None
        self._over = self._closed = False
        self._action_shape = (7 if control == "palm_twist" else 8,)
        self.action_space = spaces.Box(-1.0, 1.0, self._action_shape, np.float32)
        self.observation_space = _observation_space()
        parts = self.observation_space.spaces
        boxes = {name: part for name, part in parts.items() if isinstance(part, spaces.Box)}
        ends = np.cumsum([box.shape[0] for box in boxes.values()]).tolist()
        self._places = [(name, slice(end - boxes[name].shape[0], end)) for name, end in zip(boxes, ends, strict=True)]
        self._low = np.concatenate([box.low for box in boxes.values()])
        self._high = np.concatenate([box.high for box in boxes.values()])

    # -- Gymnasium -----------------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begins another episode. ``options``: {"person": index in the split}. ValueError: an unknown option, or an
        index that is not in the split."""
        self._check_open()
        super().reset(seed=seed)
        self._stage = self._camera = None  # frees the last world before the next one is made
        person = self._person({} if options is None else options)
        conditions = self.split.conditions(person, self.objects)
        self._stage = stage = Stage(person, conditions, self.task, CONTROLS[self.control])
        self._speeds = (
            np.array([SPEED] * 3 + [TURNING] * 3)
            if self.control == "palm_twist"
            else np.asarray(stage.world.robot.limits.velocity)
        )
        self._begun = stage.world.t
        self._stopped = ""
        self._over = False
        self._who = {"person": person, "object": conditions.object_id}
        stage.begin()
        self._referee = Referee(stage.world, self.task)
        self._away = self._distance()
        return self._observation(), self._info({})

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Follows the action for 50 ms of virtual time. ValueError: an action of another shape or with a number that is
        not finite. RuntimeError: before reset(), or after the end of the episode."""
        self._check_open()
        if self._stage is None or self._over:
            raise RuntimeError("the episode has not begun or is over; call reset() first")
        values = np.clip(finite(action, f"action of control '{self.control}'", self._action_shape), -1.0, 1.0)
        stage, referee = self._stage, self._referee
        rough = referee.rough
        self._follow(values[:-1])
        if values[-1] != 0.0:
            stage.command_hand(bool(values[-1] > 0.0))
        for _ in range(PERIODS):
            stage.world.step()
            referee.look()
            stage.look()
        failed = referee.dropped or referee.gave_up or bool(self._stopped)
        terminated = referee.success or failed
        truncated = not terminated and stage.world.t - self._begun >= self.time_limit - 1e-9
        self._over = terminated or truncated
        parts = self._reward(referee.rough - rough, failed)
        return self._observation(), float(sum(parts.values())), terminated, truncated, self._info(parts)

    def render(self) -> np.ndarray | None:
        """Returns a picture (480, 640, 3) of the cell, or None without render_mode."""
        if self._camera_type is None or self._stage is None:
            return None
        if self._camera is None:
            self._camera = camera = self._camera_type(self._stage.world.cell, 640, 480)
            camera.look([0.7, 0.0, 0.4], 1.6, -84.0, -15.0)
            camera.set_colour("world", (0.86, 0.87, 0.88))
            for number in range(1, 7):
                camera.set_colour(f"lwr_link_{number}", (0.93, 0.45, 0.10))
            camera.set_colour("object", (0.85, 0.12, 0.12))
            camera.set_colour("person_hand", (0.89, 0.69, 0.56))
        picture: np.ndarray = self._camera.draw().copy()
        return picture

    def close(self) -> None:
        """Frees the world. The environment cannot be used any more."""
        self._stage = self._camera = None
        self._over = self._closed = True

    # -- inside --------------------------------------------------------------------------------------------------

    @property
    def stage(self) -> Stage:
        """The world of this episode, for pictures and analysis; policies must not read it. RuntimeError: none yet."""
        if self._stage is None:
            raise RuntimeError("there is no episode; call reset() first")
        return self._stage

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("this environment is closed; make another one")

    def _person(self, options: Mapping[str, Any]) -> int:
        if not isinstance(options, Mapping):
            raise ValueError(f"options is {options!r}; a dictionary such as {{'person': 7}} is expected")
        unknown = sorted(set(options) - {"person"})
        if unknown:
            raise ValueError(f"options has {', '.join(map(str, unknown))}; the only option is person")
        seeds = self.split.seeds
        index = options.get("person")
        if index is None:
            index = int(self.np_random.integers(len(seeds)))
        if isinstance(index, bool) or not isinstance(index, (int, np.integer)) or not 0 <= index < len(seeds):
            raise ValueError(f"person is {index!r}; split '{self.split.name}' has people 0 to {len(seeds) - 1}")
        return seeds[int(index)]

    def _follow(self, shares: np.ndarray) -> None:
        virtual = self.stage.world.robot.virtual
        send = virtual.stream_twist if self.control == "palm_twist" else virtual.stream_joint_velocity
        good, why = send((shares * self._speeds).tolist())
        if not good:
            self._stopped = str(self.stage.world.robot.report["reason"] or why)

    def _distance(self) -> float:
        """Returns the distance (m) of the palm from its true place at the handover."""
        stage = self.stage
        truth = stage.world.cell.truth()
        anchor = pose_of_truth(truth["object" if self.task == RECEIVE else "human_hand"])
        return length(np.asarray(truth["robot_hand"]["position"]) - anchor.apply(stage.goal.position))

    def _reward(self, rough: float, failed: bool) -> dict[str, float]:
        w, referee = self.weights, self._referee
        away, before = self._distance(), self._away
        self._away = away
        met = referee.force > 0.0 or referee.success
        return {
            "end": w.success * referee.success - w.failure * failed,
            "progress": 0.0 if met else w.progress * (before - away),
            "time": -w.time / RATE,
            "force": -w.force * rough,
        }

    def _info(self, parts: dict[str, float]) -> dict[str, Any]:
        return {**self._referee.info(), "stopped": self._stopped, **self._who, "reward": parts}

    def _observation(self) -> dict[str, Any]:
        stage = self.stage
        world, report = stage.world, stage.world.robot.report
        hand, hand_age = world.newest("human_hand")
        thing, thing_age = world.newest(world.object_frame)
        seen: dict[str, Any] = {
            "joints": report["position"],
            "joint_velocity": report["measured_velocity"],
            "palm": _numbers(stage.palm()),
            "fingers": stage.fingers(),
            "holding": [float(world.hand.holding)],
            "human_hand": _numbers(hand),
            "human_hand_age": [hand_age],
            "object": _numbers(thing),
            "object_age": [thing_age],
            "goal": _numbers(stage.goal),
            "external_torque": report["external_torque"],
            "time": [world.t - self._begun],
        }
        # Clip all values in one call: a step has little time.
        flat = np.concatenate([seen[name] for name, _ in self._places])
        bounded = np.clip(flat, self._low, self._high).astype(np.float32)
        observation: dict[str, Any] = {name: bounded[place] for name, place in self._places}
        observation["phase"] = np.int64(stage.phase)
        return observation


class ReceiveEnv(HandoverEnv):
    """The robot receives an object from a person. See HandoverEnv."""

    task = RECEIVE


class GiveEnv(HandoverEnv):
    """The robot gives the object that it holds to a person. See HandoverEnv."""

    task = GIVE


def _numbers(pose: Pose | None) -> np.ndarray:
    """Position and quaternion, (7,). The quaternion has w >= 0, so that equal orientations are equal numbers."""
    if pose is None:
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    turn = np.asarray(pose.orientation, dtype=float)
    return np.concatenate([np.asarray(pose.position, dtype=float), -turn if turn[3] < 0.0 else turn])


def _observation_space() -> spaces.Dict:
    def box(low: float, high: float, size: int) -> spaces.Box:
        return spaces.Box(low, high, (size,), np.float32)

    def pose() -> spaces.Box:
        far = np.array([FARTHEST] * 3 + [1.0] * 4, dtype=np.float32)
        return spaces.Box(-far, far, dtype=np.float32)

    return spaces.Dict(
        {
            "joints": box(-np.pi, np.pi, 7),
            "joint_velocity": box(-10.0, 10.0, 7),
            "palm": pose(),
            "fingers": box(0.0, 1.0, 5),
            "holding": box(0.0, 1.0, 1),
            "human_hand": pose(),
            "human_hand_age": box(0.0, OLDEST, 1),
            "object": pose(),
            "object_age": box(0.0, OLDEST, 1),
            "goal": pose(),
            "external_torque": box(-STRONGEST, STRONGEST, 7),
            "phase": spaces.Discrete(4),
            "time": box(0.0, 600.0, 1),
        }
    )


def _camera_type() -> Any:
    """The off-screen camera. ImportError: it was not built."""
    try:
        from coglab_sim._camera import Camera
    except ImportError as error:
        raise ImportError(
            f"render_mode 'rgb_array' needs the camera ({error}); ./coglab film builds it, with Debian's EGL"
        ) from error
    return Camera
