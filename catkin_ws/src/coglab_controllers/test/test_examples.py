"""The numbered examples run, draw and say what they are about: each curve against the cores; the stubs are typed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
EXAMPLES = PACKAGE / "examples"
NUMBERED = sorted(EXAMPLES.glob("[0-9][0-9]_*.py"))
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
PRIMITIVES = PACKAGE / "config" / "primitives.xml"
CYCLE = 0.005
UNIT = [0.0, 0.0, 0.0, 1.0]

# Runs an example as its user does, and then tells what its figure holds.
DRIVER = """
import json, runpy, sys
example, folder = sys.argv[1:]
sys.argv = [example, folder]
sys.path.insert(0, example.rpartition("/")[0])
runpy.run_path(example, run_name="__main__")
from matplotlib import pyplot

def line(one):
    data = one.get_data_3d() if hasattr(one, "get_data_3d") else one.get_data()
    return {"label": one.get_label(), "data": [list(map(float, axis)) for axis in data], "style": one.get_linestyle(),
            "width": one.get_linewidth(), "color": str(one.get_color()), "size": one.get_markersize()}

def axes(one):
    legend = one.get_legend()
    names = [one.get_xlabel(), one.get_ylabel()] + ([one.get_zlabel()] if hasattr(one, "get_zlabel") else [])
    return {"names": names, "lines": [line(each) for each in one.lines],
            "legend": [text.get_text() for text in legend.get_texts()] if legend else [],
            "font": legend.get_texts()[0].get_fontsize() if legend else 0, "columns": legend._ncols if legend else 0}

figure = pyplot.gcf()
print(json.dumps({"size": list(figure.get_size_inches()), "axes": [axes(each) for each in figure.axes]}))
"""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[list[dict], list[str]]]:
    """Of an example: its axes, and the lines that it prints."""

    def run(name: str, width: float, height: float) -> tuple[list[dict], list[str]]:
        folder = tmp_path_factory.mktemp(name)
        command = [sys.executable, "-c", DRIVER, str(EXAMPLES / f"{name}.py"), str(folder)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr[-2000:]
        *told, last = done.stdout.splitlines()
        figure = json.loads(last)
        assert figure["size"] == [width, height]
        png = (folder / f"{name}.png").read_bytes()
        size = [int.from_bytes(png[at : at + 4], "big") for at in (16, 20)]
        assert size == [round(80 * width), round(80 * height)], "80 points to the inch"
        assert told[-1] == f"plot: {folder / name}.png"
        return figure["axes"], told[:-1]

    return run


def test_examples_are_numbered_have_their_plot_and_are_looked_at_here() -> None:
    assert [int(e.name[:2]) for e in NUMBERED] == list(range(1, len(NUMBERED) + 1)) and len(NUMBERED) >= 6
    for example in NUMBERED:
        assert example.with_suffix(".png").stat().st_size > 5000
        assert any(name.startswith(f"test_{example.name[:2]}_") for name in globals()), example


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def check(line: dict, *data: object) -> None:
    for one, other in zip(line["data"], data, strict=True):
        np.testing.assert_allclose(one, np.asarray(other, dtype=float), rtol=0.0, atol=1e-9)


def loaded() -> cc.Library:
    library = cc.Library()
    library.load(str(PRIMITIVES))
    return library


def test_01_a_primitive_that_was_learnt_is_drawn_to_its_goals(drawn) -> None:
    (axes,), told = drawn("01_learn_and_reproduce", 7.0, 5.0)
    times = np.linspace(0.0, 1.2, 241)
    way = minimum_jerk(times / 1.2)
    path = np.outer(way, [0.5, 0.0, 0.1]) + np.outer(np.sin(np.pi * way), [0.0, 0.0, 0.08])
    check(axes["lines"][0], *path.T)
    assert (axes["lines"][0]["style"], axes["lines"][0]["label"]) == ("--", "demonstration")
    primitive = cc.learn("lifted_reach", [(times, path)], basis_count=20, mapping="upright")
    worst = np.linalg.norm(cc.reproduce(primitive, times) - path, axis=1).max()
    assert told == [f"reproduced within {1000 * worst:.2f} mm"] and worst < 1e-3
    goals = ([0.5, 0.0, 0.1], [0.3, 0.4, 0.2], [-0.2, 0.4, 0.0], [0.1, -0.3, -0.1])
    for line, goal in zip(axes["lines"][1:], goals, strict=True):
        check(line, *cc.Dmp(primitive, [0.0] * 3, goal).roll_out(goal, 1.5)[1].T)
        assert line["label"] == f"to {goal}"
    assert axes["legend"] == [line["label"] for line in axes["lines"]] and axes["font"] == 7.0
    assert axes["names"] == ["x [m]", "y [m]", "z [m]"]


def trembling() -> tuple[np.ndarray, np.ndarray]:
    """Times, and the goal as a camera sees it at them: aside at 0.4 s, adrift until 1.5 s, with 3 mm of noise."""
    times = np.arange(0.0, 3.0, CYCLE)
    seen, rng = np.zeros((600, 3)), np.random.default_rng(1)
    for i, time in enumerate(np.floor(30.0 * times) / 30.0):
        seen[i] = [0.5, 0.0 if time < 0.4 else 0.1 + 0.05 * (min(time, 1.5) - 0.4), 0.0]
    for i in range(0, 600, 7):
        seen[i : i + 7] += rng.normal(scale=0.003, size=3)
    return times, seen


def test_02_a_goal_that_moves_is_followed_with_and_without_the_estimator(drawn) -> None:
    (top, bottom), told = drawn("02_moving_goal", 7.0, 5.0)
    times, seen = trembling()
    check(top["lines"][0], times, seen[:, 1])
    assert (top["lines"][0]["color"], top["lines"][0]["label"]) == ("0.7", "goal as received")
    events, smooth = [], []
    for at, (constant, label) in enumerate(((0.0, "estimator off"), (0.06, "estimator 0.06 s"))):
        motion, rows = cc.CartesianMotion(constant), []
        motion.start(loaded()["reach_human"], [0, 0, 0], UNIT, seen[0], UNIT)
        for time, goal in zip(times, seen, strict=True):
            motion.step(CYCLE, goal, UNIT)
            rows.append((motion.position[1], motion.acceleration[1]))
            if motion.event:
                events.append(f"{label}: {motion.event} at {time:.2f} s")
        check(top["lines"][at + 1], times, np.array(rows)[:, 0])
        check(bottom["lines"][at], times, np.array(rows)[:, 1])
        assert top["lines"][at + 1]["label"] == label == bottom["lines"][at]["label"]
        assert bottom["lines"][at]["width"] == 0.8
        smooth.append(np.abs(np.array(rows)[:, 1]).max())
    assert told == events and smooth[1] < smooth[0], "the estimator takes the trembling away"
    assert top["legend"] == ["goal as received", "estimator off", "estimator 0.06 s"]


def test_03_a_switch_in_mid_motion_makes_no_step(drawn) -> None:
    (left, right), told = drawn("03_switch_in_mid_motion", 9.0, 4.0)
    library, goal = loaded(), np.array([0.4, 0.0, -0.2])
    cases = (("reach_human", 1.0), ("reach_human", 2.0), ("put_board", 1.0))
    for (name, ratio), way, speed in zip(cases, left["lines"], right["lines"], strict=True):
        dmp, path, speeds = cc.Dmp(library["reach_human"], [0.0] * 3, goal), [], []
        for i in range(500):
            if i == 100:
                dmp.switch_to(library[name], goal, ratio)
            path.append(dmp.step(CYCLE, goal))
            speeds.append(np.linalg.norm(dmp.velocity))
        check(way, np.array(path)[:, 0], np.array(path)[:, 2])
        check(speed, CYCLE * np.arange(500), speeds)
        assert way["label"] == f"{name}, ratio {ratio}"
        assert np.abs(np.diff(speeds)).max() < 0.1, "no step"
    assert told == [] and left["legend"] == [line["label"] for line in left["lines"]]


def test_04_the_rotation_shrinks_before_the_translation(drawn) -> None:
    axes, _ = drawn("04_two_task_ik", 7.0, 6.0)
    chain, limits = cc.Chain(URDF.read_text()), cc.load_joint_limits(str(LIMITS))
    start = np.array([0.9, 0.9, -0.4, -1.5, 0.3, 0.9, 0.2])
    position, orientation = chain.fk(start)
    goal, target = position + [0.1, -0.45, 0.15], chain.fk(start + [0, 0, 0, 0, 0.6, -0.5, 0.4])[1]
    worst = []
    for at, (first, label) in enumerate(((True, "rotation shrunk first"), (False, "whole vector scaled"))):
        ik = cc.TwoTaskIk(rotation_first_scaling=first, velocity_limit=0.6 * limits.velocity)
        motion, q, velocity, rows = cc.CartesianMotion(), start.copy(), np.zeros(7), []
        motion.start(loaded()["reach_human"], position, orientation, goal, target)
        for _ in range(360):
            result = ik.solve(chain, q, motion.step(CYCLE, goal, target), velocity=velocity, dt=CYCLE)
            velocity = result.velocity
            errors = np.linalg.norm(result.position_error), np.linalg.norm(result.rotation_error)
            rows.append((1000.0 * errors[0], np.degrees(errors[1]), np.abs(velocity / limits.velocity).max()))
            q = q + CYCLE * velocity
        for one, values in zip(axes, np.transpose(rows), strict=True):
            check(one["lines"][at], CYCLE * np.arange(360), values)
            assert one["lines"][at]["label"] == label
        worst.append(max(row[0] for row in rows))
    assert worst[0] <= worst[1]
    names = [one["names"][1] for one in axes]
    assert names == ["position error [mm]", "orientation error [deg]", "share of speed limit"]
    assert [bool(one["legend"]) for one in axes] == [True, False, False]
    assert [one["names"][0] for one in axes] == ["", "", "time [s]"]


def test_05_a_point_to_point_motion_is_followed_by_the_interpolator(drawn) -> None:
    (axes,), told = drawn("05_point_to_point", 7.0, 4.0)
    limits = cc.load_joint_limits(str(LIMITS))
    start, velocity = [0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0], [0.5, -0.2, 0.0, 0.3, 0.0, 0.0, -0.6]
    target = np.array([-0.6, 0.9, 0.4, -1.6, 0.5, 0.4, 1.0])
    motion = cc.PtpTrajectory(start, velocity, target, 0.5 * limits.velocity, 0.3 * limits.acceleration)
    arm, rows = cc.Interpolator(limits), []
    arm.reset(np.array(start))
    times = np.arange(0.0, motion.duration + 0.5, CYCLE)
    for t in times:
        position, speed, _ = motion.at(t)
        arm.step(speed + 10.0 * (position - arm.position), CYCLE)
        rows.append((speed, arm.velocity))
    planned, followed = np.transpose(rows, (1, 2, 0))
    off = np.degrees(np.abs(arm.position - target).max())
    assert told == [
        f"all joints arrive after {motion.duration:.3f} s",
        f"off by {off:.4f} deg after another 0.5 s",
    ]
    for joint, name in enumerate(("a1", "a2", "e1", "a3", "a4", "a5", "a6")):
        dashed, solid = axes["lines"][joint], axes["lines"][7 + joint]
        check(dashed, times, planned[joint])
        check(solid, times, followed[joint])
        assert (dashed["style"], dashed["width"], solid["style"], solid["label"]) == ("--", 0.8, "-", name)
        assert solid["color"] == dashed["color"]
    assert len(axes["lines"]) == 14 and axes["legend"] == ["a1", "a2", "e1", "a3", "a4", "a5", "a6"]
    assert axes["columns"] == 4


def test_06_a_guard_names_its_reason(drawn) -> None:
    (axes,), told = drawn("06_limits", 7.0, 3.5)
    chain, limits = cc.Chain(URDF.read_text()), cc.load_joint_limits(str(LIMITS))
    guard = cc.Guard(chain, limits, cc.WorkspaceParameters(box_max=[1.2, 0.45, 1.6]), hand_speed=0.4)
    arm, rows = cc.Interpolator(limits), []
    arm.reset(np.array([0.0, 0.6, 0.0, -1.2, 0.0, 0.8, 0.0]))
    for i in range(600):
        result = guard.limit(chain, arm.position, np.array([0.5, 0.2, 0.0, 0.3, 0.4, 0.0, 1.4]))
        arm.step(result.velocity, CYCLE)
        rows.append((CYCLE * i, result.scale, result.reason))
    reasons = list(dict.fromkeys(row[2] for row in rows))
    assert axes["legend"] == [line["label"] for line in axes["lines"]] == reasons and len(reasons) >= 2
    for line, reason in zip(axes["lines"], reasons, strict=True):
        check(line, *np.array([row[:2] for row in rows if row[2] == reason]).T)
        assert (line["style"], line["size"]) == ("None", 3.0)
    assert told == []


def test_a_plot_lies_beside_its_script_unless_a_folder_is_given(tmp_path: Path) -> None:
    call = f"import sys; sys.path.insert(0, {str(EXAMPLES)!r}); import example_files as e; e.pyplot.plot([0, 1]); "
    call += f"e.save_plot({str(tmp_path / 'mine.py')!r})"
    (tmp_path / "there").mkdir()
    for arguments, place in (([], tmp_path), ([str(tmp_path / "there")], tmp_path / "there")):
        done = subprocess.run([sys.executable, "-c", call, *arguments], capture_output=True, text=True, timeout=60)
        assert done.stdout == f"plot: {place / 'mine.png'}\n", done.stderr[-2000:]
        assert (place / "mine.png").is_file()


def test_the_packages_primitives_are_those_that_are_made(tmp_path: Path) -> None:
    """With a file and without: the same, as the package has it; and what is said of each."""
    script = str(EXAMPLES / "make_primitives.py")
    for arguments, file in (([], "primitives.xml"), (["mine.xml"], "mine.xml")):
        command = [sys.executable, script, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)
        assert done.returncode == 0, done.stderr[-2000:]
        made = cc.Library()
        made.load(str(tmp_path / file))
    there = loaded()
    assert made.ids() == there.ids() and sorted(p.name for p in tmp_path.iterdir()) == ["mine.xml", "primitives.xml"]
    for name in there.ids():
        one, other = made[name], there[name]
        assert (one.description, one.mapping, one.duration) == (other.description, other.mapping, other.duration)
        for field in ("centres", "widths", "weights", "start", "goal", "start_velocity", "alpha", "stiffness"):
            np.testing.assert_allclose(getattr(one, field), getattr(other, field), rtol=1e-7, atol=1e-7, err_msg=name)
    said = [line.split(": ") for line in done.stdout.splitlines()]
    names = ["reach_human", "reach_human_high", "give_human", "take_board", "put_board"]
    assert [line[0] for line in said] == names
    for name, words in said:
        seconds, rest = words.split(" s, worst deviation ")
        assert float(seconds) == pytest.approx(there[name].duration, abs=0.05)
        assert 0.0 < float(rest.removesuffix(" mm")) < 5.0


@pytest.mark.skipif(shutil.which("mypy") is None, reason="mypy is not installed")
def test_stubs_satisfy_mypy() -> None:
    stub = PACKAGE / "src" / "coglab_controllers" / "_core.pyi"
    result = subprocess.run(
        ["mypy", "--strict", "--no-error-summary", "--follow-imports=skip", str(stub)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stdout
