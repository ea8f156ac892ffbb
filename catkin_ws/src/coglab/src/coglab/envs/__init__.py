"""Gymnasium environments over the virtual world: the robot receives an object from a person, or gives one.

``coglab/Receive-v0`` and ``coglab/Give-v0``. Importing this package registers them::

    import gymnasium
    import coglab.envs

    env = gymnasium.make("coglab/Receive-v0", split="train")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Many at once, each in its own process: ``coglab.envs.make_vec("coglab/Receive-v0", 4)``. The table of baselines:
``python3 -m coglab.envs leaderboard``.
"""

from __future__ import annotations

try:
    import gymnasium
except ImportError as error:
    raise ImportError(
        "coglab.envs needs the Python package gymnasium: ./coglab extras installs it, or pip install gymnasium==1.2.1"
    ) from error

from functools import partial
from typing import Any

from coglab.envs.handover import GiveEnv, HandoverEnv, ReceiveEnv
from coglab.envs.people import SPLITS, Split
from coglab.values import whole
from coglab.workers import search_workspace_first

IDS = {"coglab/Receive-v0": ReceiveEnv, "coglab/Give-v0": GiveEnv}

for _id, _environment in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(id=_id, entry_point=f"coglab.envs.handover:{_environment.__name__}")


def _make(identity: str, arguments: dict[str, Any]) -> gymnasium.Env:
    return gymnasium.make(identity, **arguments)


def make_vec(identity: str, num_envs: int, **arguments: Any) -> gymnasium.vector.AsyncVectorEnv:
    """Returns ``num_envs`` environments that run beside each other, each in a new process.

    ``identity``: "coglab/Receive-v0" or "coglab/Give-v0". ``arguments``: those of the environment. Call it below
    ``if __name__ == "__main__":``, because new processes import the main script. Close it after use.

    ValueError: another identity, or fewer than one environment.
    """
    if identity not in IDS:
        raise ValueError(f"'{identity}' is none of {', '.join(IDS)}")
    if whole(num_envs, "num_envs") < 1:
        raise ValueError(f"num_envs is {num_envs}; expected at least 1")
    search_workspace_first()
    made = [partial(_make, identity, arguments) for _ in range(num_envs)]
    return gymnasium.vector.AsyncVectorEnv(made, context="spawn")


__all__ = ["IDS", "SPLITS", "GiveEnv", "HandoverEnv", "ReceiveEnv", "Split", "make_vec"]
