"""The Python module of the cores: shapes, errors, agreement with numpy, golden files and the package's primitives."""

from __future__ import annotations

import ast
import csv
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
GOLDEN = PACKAGE / "test" / "golden"
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
HOME = np.array([0.1, 0.6, -0.2, -1.3, 0.3, 0.9, 0.2])


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def numpy_dmp(primitive: cc.Primitive, goal: np.ndarray, steps: int, dt: float) -> np.ndarray:
    """Eq. (1)-(5) with w = 1 - s, integrated in numpy by fine Runge-Kutta steps."""
    tau, x, v, s = primitive.duration, primitive.start.copy(), np.zeros(3), 1.0
    stiffness, damping = primitive.stiffness, primitive.damping

    def slope(phase: float, xx: np.ndarray, vv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        psi = np.exp(-primitive.widths * (phase - primitive.centres) ** 2)
        phi = psi @ primitive.weights / psi.sum()
        w = 1.0 - phase
        force = (1 - w) * stiffness * (phi + primitive.start - xx) + w * stiffness * (goal - xx) - damping * vv
        return vv / tau, force / tau

    path = []
    for _ in range(steps):
        half, end = (s * np.exp(-primitive.alpha * h / tau) for h in (dt / 2, dt))
        a1, b1 = slope(s, x, v)
        a2, b2 = slope(half, x + dt / 2 * a1, v + dt / 2 * b1)
        a3, b3 = slope(half, x + dt / 2 * a2, v + dt / 2 * b2)
        a4, b4 = slope(end, x + dt * a3, v + dt * b3)
        x = x + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        v = v + dt / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
        s = end
        path.append(x)
    return np.array(path)


def test_dmp_equals_the_equations_in_numpy(reach: cc.Primitive) -> None:
    goal = np.array([0.3, 0.4, 0.2])
    plain = cc.Primitive()
    for field in ("id", "duration", "alpha", "stiffness", "damping", "start", "centres", "widths", "weights", "goal"):
        setattr(plain, field, getattr(reach, field))
    dmp = cc.Dmp(plain, plain.start, goal)
    times, positions, velocities = dmp.roll_out(goal, 1.5, 0.005)
    assert times.shape == (301,) and positions.shape == (301, 3) and velocities.shape == (301, 3)
    np.testing.assert_allclose(positions[1:], numpy_dmp(plain, goal, 300, 0.005), atol=1e-12)
    np.testing.assert_allclose(np.gradient(positions, times, axis=0)[5:-5], velocities[5:-5], atol=5e-4)


def test_learning_reproduces_and_maps_to_other_goals(reach: cc.Primitive) -> None:
    times = np.linspace(0.0, 1.2, 121)
    wanted = np.outer(minimum_jerk(times / 1.2), [0.5, 0.0, 0.1])
    assert np.abs(cc.reproduce(reach, times) - wanted).max() < 5e-4
    goal = np.array([-0.2, 0.3, 0.5])
    _, path, _ = cc.Dmp(reach, [0, 0, 0], goal).roll_out(goal, 2.4)
    assert np.linalg.norm(path[-1] - goal) < 1e-3
    off_line = path - np.outer(path @ goal / (goal @ goal), goal)
    assert np.linalg.norm(off_line, axis=1).max() < 1e-6


def demonstration(length: float = 0.5, duration: float = 1.2, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0.0, duration, 121)
    path = np.outer(minimum_jerk(times / duration), [length, 0.0, 0.0])
    return times, path + np.random.default_rng(1).normal(0.0, noise, path.shape)


def jumping() -> tuple[np.ndarray, np.ndarray]:
    times, path = demonstration()
    path[60:] += [0.0, 0.15, 0.0]
    return times, path


@pytest.mark.parametrize(
    ("fault", "bad"),
    [
        ("short", demonstration(length=0.006, duration=0.49)),  # a bad cut of a noisy track
        ("brief", demonstration(duration=0.2)),
        ("jump", jumping()),
        ("moving", tuple(part[30:90] for part in demonstration())),
        ("noisy", demonstration(duration=3.0, noise=0.012)),
    ],
)
def test_demonstrations_that_are_no_reach_are_refused_unless_allowed(fault: str, bad: tuple) -> None:
    cc.learn("good", [demonstration(noise=0.002)])
    with pytest.raises(ValueError, match=f"demonstration 1: {fault}: "):
        cc.learn("bad", [bad])
    rest = {"short", "brief", "jump", "moving", "noisy"} - {fault}
    with pytest.raises(ValueError, match=f"{fault}: "):
        cc.learn("bad", [bad], allow=sorted(rest))
    assert cc.learn("bad", [bad], allow=[fault]).id == "bad"
    with pytest.raises(ValueError, match="allow: .*short, brief"):
        cc.learn("bad", [bad], allow=["everything"])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: cc.learn("a", []), "one demonstration"),
        (lambda: cc.learn("a", [([0, 1], [[0, 0, 0], [1, 1, 1]])]), "5 samples"),
        (lambda: cc.learn("a b", [(np.arange(9.0), np.ones((9, 3)) * np.arange(9.0)[:, None])]), "id: "),
        (lambda: cc.learn("a", [(np.arange(9.0), np.full((9, 3), np.nan))]), "position"),
        (lambda: cc.GoalWeight("cubic"), "'linear'.*'sigmoid'"),
        (lambda: cc.CartesianReference([0, 0, 0], [0, 0, 0, 2.0]), "quaternion"),
        (lambda: cc.CartesianReference([0, np.inf, 0], [0, 0, 0, 1.0]), "finite"),
        (lambda: cc.TwoTaskIk(pos_clik_gain=-1.0), "pos_clik_gain"),
        (lambda: cc.PtpTrajectory(HOME, HOME, HOME, HOME * 0, HOME), "max_vel[0]"),
        (lambda: cc.PhaseGovernor(0.0), "positive"),
        (lambda: cc.GoalFilter(-1.0), "time constant"),
        (lambda: cc.Chain("<robot/>"), "URDF"),
    ],
)
def test_wrong_input_is_refused_in_words(call, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("[", r"\[")):
        call()


def golden() -> ModuleType:
    """make_golden.py, the derivation of the golden files from the equations."""
    spec = importlib.util.spec_from_file_location("make_golden", GOLDEN / "make_golden.py")
    assert spec is not None and spec.loader is not None
    module = sys.modules["make_golden"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_golden_files_follow_from_the_equations_and_not_from_what_they_test() -> None:
    source = ast.parse((GOLDEN / "make_golden.py").read_text())
    imports = [n.module if isinstance(n, ast.ImportFrom) else n.names[0].name for n in ast.walk(source)
               if isinstance(n, (ast.Import, ast.ImportFrom))]  # fmt: skip
    assert sorted(imports) == ["__future__", "dataclasses", "numpy", "pathlib", "xml.etree.ElementTree"]
    derivation = golden()
    learnt = derivation.derive()
    for name, text in (("weights.xml", derivation.library(learnt)), ("motions.csv", derivation.motions(learnt))):
        stored = (GOLDEN / name).read_text()
        assert re.sub(r"[-\d.e]+", "", stored) == re.sub(r"[-\d.e]+", "", text), f"{name}: run make_golden.py"
        np.testing.assert_allclose(numbers(stored), numbers(text), rtol=1e-7, atol=1e-7, err_msg=name)


def test_golden_files_mean_the_same_as_in_cpp() -> None:
    weights, learnt = cc.Library(), cc.Library()
    assert weights.load(str(GOLDEN / "weights.xml")) == 3
    assert weights.format() == (GOLDEN / "weights.xml").read_text()
    assert learnt.load(str(GOLDEN / "demonstrations.xml")) == 3
    for name in weights.ids():
        np.testing.assert_allclose(learnt[name].weights, weights[name].weights, atol=1e-6)
    with (GOLDEN / "motions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 60
    for name in weights.ids():
        primitive = weights[name]
        goal = primitive.goal + [0.05, -0.1, 0.02]
        _, path, _ = cc.Dmp(primitive, primitive.start, goal, ratio=1.3).roll_out(goal, 2.0)
        for entry in (r for r in rows if r["primitive"] == name):
            expected = [float(entry[axis]) for axis in "xyz"]
            np.testing.assert_allclose(path[int(entry["step"])], expected, rtol=0, atol=2e-8)


def test_the_packages_primitives_reach_their_goals() -> None:
    library = cc.Library()
    assert library.load(str(PACKAGE / "config" / "primitives.xml")) == 5
    assert library.ids() == ["give_human", "put_board", "reach_human", "reach_human_high", "take_board"]
    rng = np.random.default_rng(2)
    for name in library.ids():
        for _ in range(20):
            start, goal = rng.uniform(-0.5, 0.5, (2, 3))
            _, path, speed = cc.Dmp(library[name], start, goal).roll_out(goal, 1.6 * library[name].duration)
            assert np.linalg.norm(path[-1] - goal) < 1e-3
            assert np.linalg.norm(speed, axis=1).max() < 4.0 * np.linalg.norm(goal - start)
        lifted = np.array([0.4, 0.3, 0.1])
        _, path, _ = cc.Dmp(library[name], [0.4, -0.3, 0.3], lifted).roll_out(lifted, 3.5)
        if name.endswith("board"):
            # From above: at half the height still to go, the way to the side is nearly done.
            lowering = np.argmin(np.abs(path[:, 2] - 0.2))
            assert np.linalg.norm(path[lowering, :2] - lifted[:2]) < 0.12


def test_minimum_jerk_reach_is_smooth(reach: cc.Primitive) -> None:
    _, path, velocity = cc.Dmp(reach, reach.start, reach.goal).roll_out(reach.goal, 1.2, 0.001)
    speed = np.linalg.norm(velocity, axis=1)
    assert 1.80 < speed.max() / speed.mean() < 1.95
    # Spectral arc length (Balasubramanian et al. 2015): padding 4, 10 Hz, amplitude 0.05.
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + 4)
    frequency, magnitude = np.fft.rfftfreq(size, 0.001), np.abs(np.fft.rfft(speed, size))
    magnitude = magnitude / magnitude.max()
    inside = np.nonzero((frequency <= 10.0) & (magnitude >= 0.05))[0]
    frequency, magnitude = frequency[: inside[-1] + 1], magnitude[: inside[-1] + 1]
    arc = -np.sum(np.hypot(np.diff(frequency) / frequency[-1], np.diff(magnitude)))
    assert arc >= -1.45


def test_ik_equals_numpy(chain: cc.Chain) -> None:
    ik = cc.TwoTaskIk(velocity_limit=np.full(7, 90.0))
    rng = np.random.default_rng(1)
    for _ in range(200):
        q = rng.uniform(-1.8, 1.8, 7)
        position, orientation = chain.fk(q)
        reference = cc.CartesianReference(
            position + rng.normal(scale=0.002, size=3),
            orientation,
            rng.normal(scale=0.1, size=3),
            rng.normal(scale=0.1, size=3),
        )
        result = ik.solve(chain, q, reference)
        top, bottom = np.split(chain.jacobian(q), 2)
        if np.linalg.svd(top)[1].min() < 0.02 or result.rotation_rejected:
            continue
        first = np.linalg.pinv(top) @ (reference.velocity + 20.0 * (reference.position - position))
        null_space = np.eye(7) - np.linalg.pinv(top) @ top
        second = np.linalg.pinv(bottom @ null_space) @ (reference.angular_velocity - bottom @ first)
        np.testing.assert_allclose(result.velocity, first + second, atol=1e-7)


def test_guard_interpolator_and_limits(chain: cc.Chain) -> None:
    limits = cc.load_joint_limits(str(LIMITS))
    guard = cc.Guard(chain, limits)
    result = guard.limit(chain, HOME, np.full(7, 5.0))
    assert 0.0 < result.scale < 1.0
    np.testing.assert_allclose(result.velocity, result.scale * np.full(7, 5.0))
    assert "finite" in guard.limit(chain, HOME, np.full(7, np.nan)).reason
    interpolator = cc.Interpolator(limits)
    interpolator.reset(HOME)
    last = np.zeros(7)
    for _ in range(400):
        interpolator.step(0.5 * limits.velocity, 0.005)
        assert np.all(np.abs(interpolator.velocity - last) <= limits.acceleration * 0.005 * (1 + 1e-9))
        last = interpolator.velocity
    np.testing.assert_allclose(interpolator.velocity, 0.5 * limits.velocity, rtol=1e-9)


def test_point_to_point(chain: cc.Chain) -> None:
    limits = cc.load_joint_limits(str(LIMITS))
    target = -HOME
    motion = cc.PtpTrajectory(HOME, np.zeros(7), target, 0.5 * limits.velocity, 0.5 * limits.acceleration)
    position, velocity, _ = motion.at(motion.duration)
    np.testing.assert_array_equal(position, target)
    np.testing.assert_array_equal(velocity, np.zeros(7))
    speeds = np.array([motion.at(t)[1] for t in np.linspace(0, motion.duration, 500)])
    assert np.all(np.abs(speeds) <= 0.5 * limits.velocity * (1 + 1e-9))


def test_a_motion_runs_to_its_end(chain: cc.Chain, reach: cc.Primitive) -> None:
    motion, ik, q, velocity = cc.CartesianMotion(), cc.TwoTaskIk(), HOME.copy(), np.zeros(7)
    position, orientation = chain.fk(q)
    goal = position + [0.1, 0.15, -0.1]
    motion.start(reach, position, orientation, goal, orientation)
    events = []
    for _ in range(400):
        velocity = ik.solve(chain, q, motion.step(0.005, goal, orientation), velocity=velocity, dt=0.005).velocity
        q = q + 0.005 * velocity
        events.append(motion.event)
    assert events.count("ended") == 1 and motion.phase == "ended"
    assert np.linalg.norm(chain.fk(q)[0] - goal) < 1e-3
    assert motion.remaining_time == 0.0


def test_stubs_name_everything_that_is_there() -> None:
    """Each public class, method and function of the compiled module is in the stubs, and nothing else."""
    from coglab_controllers import _core

    tree = ast.parse((PACKAGE / "src" / "coglab_controllers" / "_core.pyi").read_text())
    stubs: dict[str, set[str]] = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            members = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
            members |= {n.target.id for n in node.body if isinstance(n, ast.AnnAssign)}
            stubs[node.name] = {m for m in members if not m.startswith("__")}
        elif isinstance(node, ast.FunctionDef):
            stubs[node.name] = set()
        elif isinstance(node, ast.AnnAssign):
            stubs[node.target.id] = set()
    there = {name for name in dir(_core) if not name.startswith("_")}
    assert there == set(stubs) - {"Array", "ArrayLike"}
    assert there == set(cc.__all__)
    for name in there:
        value = getattr(_core, name)
        if isinstance(value, type) and not issubclass(value, Exception):
            public = {member for member in vars(value) if not member.startswith("_")}
            assert public == stubs[name], name
