"""The environments: Gymnasium's own checks, seeds, splits, bad input, speed of a reset, results of the leaderboard."""

import json
import math
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="./coglab extras installs it")

import coglab.envs  # noqa: E402
from coglab.envs.leaderboard import Results, row, run_policy, table, wilson  # noqa: E402
from coglab.envs.people import SPLITS  # noqa: E402
from coglab.envs.policies import StraightReach  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

RECEIVE, GIVE = "coglab/Receive-v0", "coglab/Give-v0"


@pytest.fixture
def make():
    """Makes environments without Gymnasium's wrappers, and closes them."""
    made = []

    def one(identity=RECEIVE, **arguments):
        made.append(gymnasium.make(identity, **arguments).unwrapped)
        return made[-1]

    yield one
    for env in made:
        env.close()


@pytest.mark.parametrize("identity", [RECEIVE, GIVE])
def test_gymnasium_accepts_the_environment(make, identity):
    check_env(make(identity), skip_render_check=True)


@pytest.mark.parametrize("control", ["palm_twist", "joint_velocity"])
def test_the_same_seed_and_actions_give_the_same_episode_bit_for_bit(make, control):
    def episode(seed):
        env = make(control=control)
        seen, _ = env.reset(seed=seed)
        actions, bytes_ = np.random.default_rng(1), []
        for _ in range(15):
            seen, reward, *_ = env.step(actions.uniform(-1, 1, env.action_space.shape))
            bytes_.append(b"".join(np.asarray(seen[name]).tobytes() for name in sorted(seen)) + str(reward).encode())
        return bytes_

    once = episode(5)
    assert episode(5) == once and episode(6)[-1] != once[-1]


@pytest.mark.parametrize(("identity", "task"), [(RECEIVE, "receive"), (GIVE, "give")])
def test_a_straight_reach_hands_the_mug_over(identity, task):
    figures = run_policy(StraightReach(task), task, "train", 2, objects=("mug",))
    assert figures["success"] and not figures["dropped"], figures
    assert figures["return"] > 0.8
    assert 1.0 < figures["time"] < 15.0 and 0.0 < figures["force"] < 30.0


def test_the_palm_follows_the_action(make):
    env = make()
    before, _ = env.reset(seed=1)
    for _ in range(10):
        after, *_ = env.step([0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0])  # 0.3 m/s for 0.5 s
    way = after["palm"][:3] - before["palm"][:3]
    assert way[2] == pytest.approx(0.13, abs=0.03) and np.abs(way[:2]).max() < 0.02


def test_the_hand_closes_on_command_once_and_opens_again(make):
    env = make()
    env.reset(seed=1)
    phases = []
    for grasp in [1.0] * 45 + [-1.0] * 30:
        seen, *_ = env.step([0.0] * 6 + [grasp])
        phases.append(int(seen["phase"]))
    assert list(dict.fromkeys(phases)) == [1, 2, 3, 0]


@pytest.mark.parametrize("control", ["palm_twist", "joint_velocity"])
def test_no_action_breaks_a_limit_of_the_arm(make, control):
    env = make(control=control)
    env.reset(seed=1)
    draw = np.random.default_rng(2)
    terminated = False
    for step in range(60):
        if step % 4 == 0:
            action = draw.choice([-1.0, 1.0], env.action_space.shape)
        if not terminated:
            _, _, terminated, _, info = env.step(action)
    assert env.stage.world.robot.limit_violations == 0 and not info["stopped"]


def test_observations_contain_no_true_values(make):
    env = make(GIVE)
    seen, info = env.reset(seed=1)
    assert {"force", "dropped", "success"} <= set(info) and not {"force", "dropped", "success"} & set(seen)
    truth = np.asarray(env.stage.world.truth["human_hand"]["position"])
    assert np.abs(seen["human_hand"][:3] - truth).max() > 1e-4  # the tracker's errors


def test_invalid_actions_are_refused_and_change_nothing(make):
    env = make()
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(np.zeros(7))
    env.reset(seed=1)
    for bad, words in (
        (np.zeros(6), r"'palm_twist'.*\(7,\).*\(6,\)"),
        (np.full(7, np.nan), "finite"),
        ([np.inf] * 7, "finite"),
        ("up", "shape"),
        (np.zeros(7) + 1j, "shape"),
    ):
        with pytest.raises(ValueError, match=words):
            env.step(bad)
    seen, *_ = env.step([9.0] * 7)  # the same as 1
    assert seen["time"][0] == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"split": "exam"}, "split.*'exam'.*train, validation"),
        ({"objects": ("sword",)}, "object.*'sword'.*mug"),
        ({"objects": ()}, "objects"),
        ({"control": "torque"}, "control.*'torque'.*palm_twist"),
        ({"time_limit": math.nan}, "time_limit.*nan"),
        ({"time_limit": "long"}, "time_limit"),
        ({"reward": 3}, "reward.*coglab.envs.handover.Reward"),
        ({"render_mode": "human"}, "render_mode.*'human'"),
    ],
)
def test_invalid_arguments_are_refused_with_a_reason(arguments, words):
    with pytest.raises(ValueError, match=words):
        coglab.envs.ReceiveEnv(**arguments)


def test_a_person_can_be_chosen_and_an_unknown_one_is_refused(make):
    env = make(split="test")
    assert env.reset(options={"person": 7})[1]["person"] == SPLITS["test"].seeds[7]
    for options, words in (
        ({"person": 300}, "299"),
        ({"people": 1}, "person"),
        (3, "dict"),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(options=options)


def test_a_closed_environment_is_refused_with_a_reason(make):
    env = make()
    env.reset(seed=1)
    env.close()
    for call in (env.reset, lambda: env.step(np.zeros(7))):
        with pytest.raises(RuntimeError, match="is closed"):
            call()


def test_an_episode_that_lasts_too_long_is_truncated_and_then_over(make):
    env = make(time_limit=0.2)
    env.reset(seed=1)
    ends = [env.step(np.zeros(7))[2:4] for _ in range(4)]
    assert ends == [(False, False)] * 3 + [(False, True)]
    with pytest.raises(RuntimeError, match="is over"):
        env.step(np.zeros(7))


def test_a_stopped_arm_ends_the_episode_with_its_reason(make):
    env = make()
    env.reset(seed=1)
    env.stage.world.cell.leave_command_mode("drives off")
    for _ in range(5):
        _, _, terminated, _, info = env.step(np.zeros(7))
        if terminated:
            break
    assert terminated and info["stopped"] and not info["success"]


def test_a_picture_shows_the_cell(make):
    pytest.importorskip("coglab_sim._camera", reason="built by ./coglab film alone")
    env = make(render_mode="rgb_array")
    env.reset(seed=1)
    picture = env.render()
    assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
    red = (picture[..., 0] > 100) & (picture[..., 1] < 60)
    assert 10 < red.sum() < 20_000  # the mug


def test_nobody_is_in_two_splits():
    people = [set(SPLITS[name].seeds) for name in ("train", "validation", "test")]
    assert sum(map(len, people)) == len(set.union(*people))
    assert SPLITS["test_hard"].seeds == SPLITS["test"].seeds


def test_the_hard_test_makes_each_person_harder():
    plain, hard = SPLITS["test"], SPLITS["test_hard"]
    seeds = plain.seeds[:30]
    assert all(plain.conditions(s, ("mug",)) != hard.conditions(s, ("mug",)) for s in seeds)
    assert len({str(hard.conditions(s, ("mug",))) for s in seeds}) >= 6


def test_memory_stays_over_many_resets(make):
    env = make()
    for seed in range(3):
        env.reset(seed=seed)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in range(8):
        env.reset(seed=seed)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 25_000  # kB; a world has several MB


def test_environments_in_their_own_processes():
    vector = coglab.envs.make_vec(GIVE, 2, split="validation")
    try:
        seen, info = vector.reset(seed=3)
        assert seen["joints"].shape == (2, 7) and len(set(info["person"])) == 2
        seen, reward, *_ = vector.step(np.zeros((2, 7), dtype=np.float32))
        assert reward.shape == (2,) and np.all(np.isfinite(reward))
    finally:
        vector.close()
    with pytest.raises(ValueError, match="'coglab/Throw-v0'"):
        coglab.envs.make_vec("coglab/Throw-v0", 2)


def test_wilsons_interval():
    assert wilson(0, 0) == (0.0, 1.0)
    assert wilson(98, 100) == pytest.approx((0.930, 0.9945), abs=1e-3)
    assert wilson(0, 10)[0] == 0.0 and wilson(10, 10)[1] == 1.0


def test_results_continue_after_an_incomplete_line(tmp_path):
    results, job = Results(tmp_path), ("receive", "test", "random", 0)
    line = {"person": 0, "success": True, "time": 5.0, "force": 8.0, "dropped": False}
    results.add(job, line)
    with results.path(*job[:3]).open("a") as stream:
        stream.write('{"person": 1, "succ')
    results.add(job, {**line, "person": 2, "success": False, "time": math.inf, "dropped": True})
    assert sorted(results.read(*job[:3])) == [0, 2]
    figures = row(results.read(*job[:3]).values())
    assert (figures["count"], figures["success"], figures["dropped"], figures["time"]) == (2, 0.5, 0.5, 5.0)
    shown = table(results, ["receive"], ["test"], ["random"], 300)
    assert "| coglab/Receive-v0 | test | random | 2 | 50.0 %" in shown
    assert json.loads(results.path(*job[:3]).read_text().splitlines()[0])["force"] == 8.0


def test_the_example_that_learns_runs_and_draws_its_picture(tmp_path):
    example = Path(__file__).resolve().parents[1] / "examples" / "20_learn_a_reach.py"
    small = "--generations 1 --population 2 --people 1 --validation 1 --test 1 --workers 1".split()
    command = [sys.executable, str(example), *small, "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr[-3000:]
    assert "before: success" in done.stdout and "after: success" in done.stdout
    assert (tmp_path / "20_learn_a_reach.png").stat().st_size > 5000
