"""Records of trials: contents, files, plots, fluency, and many trials."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys

import coglab
import numpy as np
import pytest
from coglab.fluency import active_intervals
from coglab.study import TrialFailed
from coglab.trial import ARRAYS, HOLDERS

EASY = {"person": "accustomed", "perfect_perception": True}


@pytest.fixture(scope="module")
def trial() -> coglab.Trial:
    with coglab.World(seed=3, **EASY) as world:
        return world.trial("receive", "give")


def test_a_trial_holds_results_phases_and_traces(trial):
    assert repr(trial).startswith("<coglab.Trial seed=3 mug, ") and len(repr(trial)) < 200
    assert trial and [result.what for result in trial.results] == ["receive", "give"]
    count = len(trial.time)
    assert count == pytest.approx((trial.end - trial.start) / 0.01, abs=3) and np.all(np.diff(trial.time) > 0.0)
    for name, shape in ARRAYS.items():
        assert getattr(trial, name).shape == (count, *shape)
        assert np.isfinite(getattr(trial, name)).all(), name
    received, given = trial.results
    middle = np.searchsorted(trial.time, given.started)
    assert HOLDERS[trial.held_by[0]] == "human" and HOLDERS[trial.held_by[middle]] == "robot"
    assert np.linalg.norm(trial.object_position[middle] - trial.palm_position[middle]) < 0.2
    assert HOLDERS[trial.held_by[-1]] == "human" and 0.1 < trial.peak_force < 30.0
    actions = [phase for phase in trial.phases if phase.path == "/coglab_master" and "exchange" in phase.state]
    assert [(p.start, p.end) for p in actions] == [
        (pytest.approx(r.started, abs=0.05), pytest.approx(r.ended, abs=0.05)) for r in trial.results
    ]
    assert [name for _, name in trial.said] == ["READY_TO_RECEIVE", "I_HAVE_IT", "READY_TO_GIVE", "YOU_HAVE_IT"]
    closed = received.marks["contact"]
    assert any(abs(when - closed) < 0.1 for when, *_ in trial.contacts)


def test_a_trial_is_plotted_saved_and_loaded(trial, tmp_path):
    trial.plot("a title").savefig(tmp_path / "trial.png")
    assert (tmp_path / "trial.png").stat().st_size > 20_000
    folder = trial.save(tmp_path / "deep" / "first")
    again = coglab.Trial.load(folder)
    for field in dataclasses.fields(trial):
        one, other = getattr(trial, field.name), getattr(again, field.name)
        assert np.array_equal(one, other) if field.name in ARRAYS else one == other, field.name
    assert again.fluency() == trial.fluency()
    with pytest.raises(FileExistsError, match="exists"):
        trial.save(folder)
    assert sorted(os.listdir(folder.parent)) == ["first"]  # nothing half written


def test_files_without_a_valid_trial_are_named(trial, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"trial.yaml"):
        coglab.Trial.load(tmp_path / "nothing")
    folder = trial.save(tmp_path / "it")
    words = (folder / "trial.yaml").read_text()
    for text, reason in (
        (words.replace("version: 1", "version: 9"), "version.*9"),
        ("[1, 2", "it"),
        ("{}", "version"),
    ):
        (folder / "trial.yaml").write_text(text)
        with pytest.raises(ValueError, match=reason):
            coglab.Trial.load(folder)
    (folder / "trial.yaml").write_text(words)
    (folder / "trial.npz").write_bytes(b"PK half a file")
    with pytest.raises(ValueError, match="it"):
        coglab.Trial.load(folder)


def test_fluency_of_known_activities():
    """Person 0-4 s and 7-10 s, robot 3-8 s, task 0-10 s."""
    fluency = coglab.fluency_of([(0.0, 4.0), (7.0, 12.0)], [(3.0, 8.0)], 0.0, 10.0)
    assert (fluency.human_idle, fluency.robot_idle) == (pytest.approx(0.3), pytest.approx(0.5))
    assert fluency.concurrent_activity == pytest.approx(0.2)
    assert fluency.functional_delay == pytest.approx((-1.0 - 1.0) / 10.0) and fluency.turns == 2
    waits = coglab.fluency_of([(0.0, 2.0)], [(5.0, 6.0)], 0.0, 10.0)
    assert waits.functional_delay == pytest.approx(0.3) and waits.concurrent_activity == 0.0
    nobody = coglab.fluency_of([], [], 1.0, 2.0)
    assert (nobody.human_idle, nobody.robot_idle, nobody.functional_delay, nobody.turns) == (1.0, 1.0, 0.0, 0)
    with pytest.raises(ValueError, match="after start"):
        coglab.fluency_of([], [], 2.0, 2.0)


def test_short_pauses_are_bridged_and_short_activities_left_out():
    times = np.arange(0.0, 3.0, 0.01)
    active = (times < 0.5) | ((times > 0.6) & (times < 1.0)) | ((times > 2.0) & (times < 2.05))
    (interval,) = active_intervals(times, active)
    assert interval == (pytest.approx(0.0), pytest.approx(1.0, abs=0.011))


def test_a_failed_action_ends_the_trial():
    with coglab.World(seed=0, behaviour="absent", **EASY) as world:
        trial = world.trial("receive", "give")
    assert not trial and len(trial.results) == 1 and trial.results[0].reason != "NONE"
    assert trial.fluency().human_idle > 0.9


def test_wrong_actions_are_refused_with_a_reason():
    with coglab.World(seed=1, **EASY) as world:
        with pytest.raises(ValueError, match="receive, give, take, put"):
            world.trial()
        with pytest.raises(ValueError, match="'juggle'"):
            world.trial("juggle")
        with pytest.raises(coglab.Refused, match="empty"):
            world.trial("give")
        with world.record() as recording:
            with pytest.raises(RuntimeError, match="with block"):
                recording.trial  # noqa: B018  (a property that is refused)
            with pytest.raises(RuntimeError, match="recorded already"), world.record():
                pass
            world.step(0.2)
        assert len(recording.trial.time) == 20 and recording.trial.results == ()


def test_objects_on_the_board_are_taken_and_put():
    with coglab.World(seed=6, object_on="board", **EASY) as world:
        trial = world.trial("take", "put")
    assert trial, trial.results
    assert HOLDERS[trial.held_by[-1]] == "board"


def durations(world: coglab.World) -> float:
    if world.seed == 99:
        raise ArithmeticError("this seed is odd")
    return world.robot.receive().duration


def test_many_trials_are_the_same_on_one_and_two_processors():
    two = coglab.trials(2, **EASY)
    one = coglab.trials(seeds=[1, 2], workers=1, **EASY)
    assert [t.seed for t in two] == [1, 2]
    for a, b in zip(one, two, strict=True):
        assert a.results == b.results and np.array_equal(a.palm_position, b.palm_position)


def test_errors_in_many_trials_name_their_cause():
    with pytest.raises(TrialFailed, match="seed 99.*this seed is odd") as failed:
        coglab.trials(seeds=[99], each=durations, **EASY)
    assert failed.value.seed == 99
    with pytest.raises(ValueError, match="lambda"):
        coglab.trials(2, each=lambda world: 1)
    with pytest.raises(ValueError, match="object: "):
        coglab.trials(1, object="teapot")
    for wrong in ({"n": 0}, {"n": 1, "seeds": [1]}, {}, {"n": 2, "workers": 0}):
        with pytest.raises(ValueError):
            coglab.trials(**wrong)


def test_import_needs_neither_ros_nor_the_simulation():
    words = "import sys, coglab.control, coglab; assert 'Robot' in dir(coglab); "
    words += "assert not {'rospy', 'coglab_sim', 'matplotlib'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", words], check=True, timeout=600)
    words = "import sys, coglab; w = coglab.World(seed=1); w.close(); assert 'rospy' not in sys.modules"
    subprocess.run([sys.executable, "-c", words], check=True, timeout=600)


def test_a_failed_connection_is_reported():
    words = "import coglab\ntry: coglab.connect('http://127.0.0.1:9')\nexcept ConnectionError as e: print(e)\n"
    words += "try: coglab.connect('ftp://nowhere')\nexcept ValueError as e: print(e)"
    done = subprocess.run([sys.executable, "-c", words], check=True, timeout=600, capture_output=True, text=True)
    assert "http://127.0.0.1:9" in done.stdout and "HOST:PORT" in done.stdout
