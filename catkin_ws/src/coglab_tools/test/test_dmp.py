"""From recordings to primitives: units, faults, cut, learning, and teaching with a hand-guided arm."""

import json
import re
import resource
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import coglab
import coglab_controllers as cc
import numpy as np
import pytest
from coglab_smach.kinematics.reachability import default_arm, home_posture
from coglab_tools.__main__ import run
from coglab_tools.command import CheckFailed, CommandError, NotThere
from coglab_tools.dmp import cut
from coglab_tools.dmp.demonstration import Demonstration
from coglab_tools.dmp.read import JOINTS, Source, read
from coglab_tools.dmp.record import record
from coglab_tools.dmp.train import add_to_library, load_beside, load_library, train

REST, DURATION = 0.6, 1.2  # s
START, WAY = np.array([0.6, -0.1, 0.4]), np.array([0.4, 0.1, 0.2])  # m


def share(u):
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def reach(rate=120.0, way=WAY, duration=DURATION):
    """Times (s) and positions (m) of a curved reach, at rest before and after."""
    times = np.arange(0.0, 2 * REST + duration, 1.0 / rate)
    s = share((times - REST) / duration)
    return times, START + np.outer(s, way) + np.outer(np.sin(np.pi * s), [0.0, 0.0, 0.05])


def write(path, header, columns):
    rows = [",".join("" if np.isnan(v) else f"{v:.6f}" for v in row) for row in np.column_stack(columns)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def follows(found, times, places):
    """True if the positions are those of the file, without repeated samples."""
    return np.allclose(found.positions, [[np.interp(t, times, c) for c in places.T] for t in found.times], atol=1e-5)


def test_units_and_lost_samples_are_detected_and_noted(tmp_path):
    times, places = reach()
    yaw = np.degrees(0.6 * share((times - REST) / DURATION))
    table = np.column_stack([1000 * times, 1000 * places, 0 * times, 0 * times, yaw, 100 * share((times - 1.0) / 0.5)])
    table[60, 1] = np.nan
    table[100, 1:4] = table[99, 1:4]
    table[120, 1:4] += 800.0  # confusion with something else
    demonstration = read(write(tmp_path / "a.csv", "t,x,y,z,roll,pitch,yaw,closing", table.T))
    said = "; ".join(demonstration.notes)
    for words in (" ms", " mm", "degrees", "percent", "finite"):
        assert words in said
    assert "repeat" in said and "jump" in said
    found = cut.reaches(demonstration)
    assert len(found) == 1
    assert np.linalg.norm(found[0].positions[-1] - START - WAY) < 0.003
    assert np.linalg.norm(found[0].positions[0] - START) < 0.003
    assert abs(found[0].duration - DURATION) < 0.2
    assert 2 * np.arccos(found[0].orientations[-1][3]) == pytest.approx(0.6, abs=0.02)
    assert found[0].closing[-1] == pytest.approx(1.0, abs=0.02)


def test_each_column_has_the_unit_of_its_name(tmp_path):
    times, places = reach()
    yaw = 3.0 * share((times - REST) / DURATION)  # degrees, as small as radians could be
    columns = [times, 1000 * places[:, 0], 100 * places[:, 1], places[:, 2], 0 * times, 0 * times, yaw]
    found = read(write(tmp_path / "a.csv", "t,x_mm,y [cm],z_m,roll_rad,pitch_rad,yaw_deg", columns))
    assert follows(found, times, places)
    assert 2 * np.arccos(found.orientations[-1][3]) == pytest.approx(np.radians(3.0), abs=1e-4)
    said = "; ".join(found.notes)
    for name, unit in (("x", "mm"), ("y", "cm"), ("yaw", "deg")):
        assert re.search(rf"\b{name}\b[^;]*\b{unit}\b", said)


@pytest.mark.parametrize(("scale", "said"), [(100.0, "--length in"), (1000.0, " mm"), (3.28, "--length ft")])
def test_a_missing_unit_of_length_is_guessed(tmp_path, scale, said):
    times, places = reach()
    found = read(write(tmp_path / "a.csv", "t,x,y,z", [times, *(scale * places).T]))
    assert any(said in note for note in found.notes)
    assert follows(found, times, places if scale >= 100.0 else scale * places)


def test_a_missing_unit_of_rotation_is_noted(tmp_path):
    times, places = reach()
    columns = [times, *places.T, 0 * times, 0 * times, 0.3 * share(times)]
    found = read(write(tmp_path / "a.csv", "t,x,y,z,roll,pitch,yaw", columns))
    assert any("--angle deg" in note for note in found.notes)


def test_columns_in_other_units_or_of_no_use_are_not_taken_silently(tmp_path):
    times, places = reach()
    columns = [times, *(places / 0.0254).T, 50.0 * share(times), 0 * times]
    found = read(write(tmp_path / "a.csv", "t,x_in,y_in,z_in,closing_percent,thumb", columns))
    assert follows(found, times, places) and found.closing.max() == pytest.approx(0.5)
    assert any("thumb" in note for note in found.notes)
    for name, unit in (("t_deg", "deg"), ("closing_deg", "deg")):
        header = "t,x,y,z,closing".replace(name.partition("_")[0], name)
        with pytest.raises(CheckFailed, match=rf"\b{unit}\b"):
            read(write(tmp_path / "b.csv", header, [times, *places.T, 90 * share(times)]))


def test_a_reach_with_a_gap_does_not_cost_the_other_one(tmp_path):
    times, places = reach()
    after = times[-1] + 0.01 + times
    kept = np.abs(times - REST - DURATION / 2) > 0.2
    columns = [np.append(times[kept], after), *np.concatenate([places[kept], places + WAY]).T]
    found = cut.reaches(read(write(tmp_path / "a.csv", "t,x,y,z", columns)))
    assert len(found) == 1 and any("gap" in note for note in found[0].notes)


def test_units_behind_names_count_in_npz_files(tmp_path):
    times, places = reach()
    np.savez(tmp_path / "a.npz", t_ms=1000 * times, position_cm=100 * places)
    assert follows(read(tmp_path / "a.npz"), times, places)


def test_a_table_with_semicolons_and_decimal_commas_is_read(tmp_path):
    times, places = reach()
    path = write(tmp_path / "a.csv", "t,x,y,z", [times, *places.T])
    text = path.read_text().replace(",", ";").replace(".", ",")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert follows(read(path), times, places)


def test_imported_demonstrations_can_be_learnt(tmp_path):
    """Noise makes the speed uneven at the start of a reach: the cut is still at the rest of the hand."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        times, places = reach(duration=float(rng.uniform(0.8, 1.6)))
        slow = 0.02 * np.exp(-(((times - REST - 0.2) / 0.05) ** 2))  # hesitates at the onset
        noisy = places - np.outer(slow, WAY) + rng.normal(0.0, 0.001, places.shape)
        path = tmp_path / f"d{seed}.csv"
        cut.reaches(Demonstration("d", times, noisy))[0].save(path)
        part = cut.reaches(read(path))[0]
        assert np.linalg.norm(part.positions[0] - START) < 0.01
        train("d", [part], 20, "none")


def test_a_jump_of_a_resting_hand_is_no_reach(tmp_path):
    times = np.arange(0.0, 3.0, 1.0 / 30.0)
    places = np.repeat(START[None], len(times), axis=0) + np.random.default_rng(1).normal(0.0, 0.0005, (len(times), 3))
    places[45:, 0] += 0.12
    with pytest.raises(CheckFailed, match=r"0\.12 m.* 1\.5"):
        cut.reaches(read(write(tmp_path / "a.csv", "t,x,y,z", [times, *places.T])))


def test_a_jump_within_a_recorded_reach_is_refused():
    times, places = reach()
    places[len(times) // 2 :, 2] += 0.11  # the tracker goes on with another thing
    with pytest.raises(CheckFailed, match=r"jumps.* 0\.1"):
        cut.reaches(Demonstration("recorded", times, places))


def test_motions_back_and_pauses_are_cut(tmp_path):
    times, there = reach()
    back = there[::-1]
    path = write(tmp_path / "a.csv", "t,x,y,z", [np.arange(3 * len(times)) / 120.0, *np.vstack([there, back, there]).T])
    recording = read(path)
    assert [d.name for d in cut.reaches(recording)] == ["a_1", "a_2"]
    assert len(cut.reaches(recording, back=True)) == 3


def test_an_arm_that_swings_back_on_release_makes_no_second_reach():
    times, there = reach()
    swing = there[-1] - np.outer(share((times - 0.1) / DURATION), 0.4 * WAY)
    whole = Demonstration("a", np.arange(2 * len(times)) / 120.0, np.vstack([there, swing]))
    (found,) = cut.reaches(whole)
    assert np.linalg.norm(found.positions[-1] - START - WAY) < 0.003 and any("back" in note for note in found.notes)


def faulty(name, tmp_path):
    """A file with one fault, and a part of the expected message."""
    times, places = reach()
    path = tmp_path / f"{name}.csv"
    if name == "empty":
        path.write_text("", encoding="utf-8")
        return path, "the file is empty"
    if name == "words":
        path.write_text("t,x,y,z\n0,1,2,left\n" + "0.1,1,2,3\n" * 20, encoding="utf-8")
        return path, ":2: expected a number for z, got 'left'"
    if name == "columns":
        path.write_text("t,x,y,z\n0,1,2\n", encoding="utf-8")
        return path, ":2: expected 4 columns, got 3"
    if name == "no_reach":
        return write(path, "t,x,y,z", [times, *(START + 0.03 * (places - START)).T]), "no reach in it"
    if name == "gap":
        kept = (times < 1.0) | (times > 1.4)
        return write(path, "t,x,y,z", [times[kept], *places[kept].T]), "a gap of 0.4"
    if name == "swap":
        places[150:] += 0.9
        return write(path, "t,x,y,z", [times, *places.T]), "jumps by 1.5"
    if name == "backward":
        times[100:] -= 0.5
        return write(path, "t,x,y,z", [times, *places.T]), "102: time goes back by 0.49"
    if name == "unit":
        return write(path, "t,x,y,z", [times, *(10 * places).T]), "name the unit with --length"
    if name == "late":
        kept = times > REST + 0.3
        return write(path, "t,x,y,z", [times[kept], *places[kept].T]), "the recording begins within it"
    if name == "half_named":
        return write(path, "t,x_mm,y,z", [times, 1000 * places[:, 0], *places[:, 1:].T]), "y, z none"
    if name == "step":
        places[120:, 0] += 0.1
        return write(path, "t,x,y,z", [times, *places.T]), "jumps by 0.1"
    if name == "turns":
        columns = [times, *places.T, 0 * times, 0 * times, 5.0 * share(times)]
        return write(path, "t,x,y,z,roll,pitch,yaw", columns), "rad or degrees? Name the unit with --angle"
    if name == "closing":
        return write(path, "t,x,y,z,closing", [times, *places.T, share(times) - 0.5]), "closing goes from -0.5 to 0.5"
    if name == "double":
        return write(path, "t,x,y,y", [times, *places.T]), ":1: two columns have the name 'y'"
    if name == "quaternion":
        q = [0 * times, 0 * times, 0 * times, 0 * times + 0.5]
        return write(path, "t,x,y,z,qx,qy,qz,qw", [times, *places.T, *q]), "quaternion of length 0.50"
    path = tmp_path / f"{name}.{'npz' if name == 'npz' else 'bag'}"
    path.write_bytes(b"no such thing" * 10)
    return path, "no npz file" if name == "npz" else "no readable bag"


FAULTS = (
    "empty",
    "words",
    "columns",
    "no_reach",
    "gap",
    "swap",
    "step",
    "late",
    "backward",
    "unit",
    "half_named",
    "quaternion",
    "turns",
    "closing",
    "double",
    "npz",
    "bag",
)


@pytest.mark.parametrize("name", FAULTS)
def test_an_unusable_file_is_refused_with_its_name_and_place(tmp_path, name):
    path, words = faulty(name, tmp_path)
    with pytest.raises(CommandError) as refused:
        cut.reaches(read(path))
    assert words in str(refused.value) and name in str(refused.value)


@contextmanager
def full_disk():
    """No file can grow beyond 100 bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize(("verb", "option", "file"), [("export", "-o", "a.npz"), ("inspect", "--plot", "a.png")])
def test_a_full_disk_leaves_no_incomplete_file(tmp_path, capsys, verb, option, file):
    with full_disk():
        assert run(["dmp", verb, "--id", "reach_human", option, str(tmp_path / file)]) == 1
    assert file in capsys.readouterr().err and list(tmp_path.iterdir()) == []


def test_a_full_disk_is_detected_before_hand_guiding(tmp_path, capsys):
    with full_disk():
        assert run(["dmp", "record", "a", "--out", str(tmp_path), "--master", "http://127.0.0.1:9"]) == 1
    assert "a.csv" in capsys.readouterr().err and list(tmp_path.iterdir()) == []


def test_a_goal_that_is_no_number_is_a_wrong_argument(capsys):
    assert run(["dmp", "inspect", "--id", "reach_human", "--goal", "nan", "0", "0"]) == 2
    assert "metres" in capsys.readouterr().err


@pytest.fixture
def bag(tmp_path):
    """A bag with a hand on /tf, the joints of the arm in degrees, and something else."""
    rosbag, rospy = pytest.importorskip("rosbag"), pytest.importorskip("rospy")
    from geometry_msgs.msg import TransformStamped
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String
    from tf2_msgs.msg import TFMessage

    times, places = reach(rate=60.0)
    path = tmp_path / "reach.bag"
    with rosbag.Bag(str(path), "w") as file:
        for t, place in zip(times, places, strict=True):
            stamp = rospy.Time.from_sec(100.0 + t)
            hand = TransformStamped()
            hand.header.stamp, hand.header.frame_id, hand.child_frame_id = stamp, "world", "human_hand"
            hand.transform.translation.x, hand.transform.translation.y, hand.transform.translation.z = place
            hand.transform.rotation.w = 1.0
            file.write("/tf", TFMessage([hand]), stamp)
            joints = JointState(name=list(JOINTS), position=list(np.degrees(home_posture() + 0.3 * share(t - REST))))
            joints.header.stamp = stamp
            file.write("/lwr/joint_states", joints, stamp)
            file.write("/say", String("reach"), stamp)
    return path


def test_a_bag_has_hands_and_joints(bag):
    hand = cut.reaches(read(bag, Source(frame="human_hand")))[0]
    assert np.linalg.norm(hand.positions[-1] - START - WAY) < 0.003
    arm = read(bag, Source(topic="/lwr/joint_states"))
    assert any("degrees" in note for note in arm.notes)
    assert np.allclose(arm.positions[0], default_arm().fk(home_posture())[0], atol=1e-6)
    with pytest.raises(CheckFailed, match="/hand.* /lwr/joint_states, /say, /tf"):
        read(bag, Source(topic="/hand"))
    with pytest.raises(CheckFailed, match="/tf.*'world'.*'nobody'"):
        read(bag, Source(frame="nobody"))


def test_noisy_recordings_with_gaps_can_be_learnt(tmp_path):
    """0.5 mm noise per axis at 120 Hz, like two recorded hands (0.3 and 0.7 mm); lost samples and 3 gaps."""
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        times, truth = reach(duration=float(rng.uniform(0.9, 1.4)))
        kept = rng.random(len(times)) > 0.03
        for at in rng.integers(20, len(times) - 20, 3):
            kept[at : at + int(rng.integers(4, 12))] = False
        raw = Demonstration("a", times[kept], truth[kept] + rng.normal(0.0, 0.0005, (int(kept.sum()), 3)))
        whole, part = cut.smooth(raw), cut.reaches(raw)[0]
        begin = whole.times[int(np.argmin(np.linalg.norm(whole.positions - part.positions[0], axis=1)))]
        path = cc.reproduce(train("a", [part], 20, "none").primitive, part.times)
        true = np.column_stack([np.interp(begin + part.times, times, column) for column in truth.T])
        errors.append(np.sqrt(np.mean(np.sum((path - true) ** 2, axis=1))))
    assert max(errors) < 0.6e-3


def answer(capsys, *words):
    status = run([*map(str, words), "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_from_files_to_a_checked_library(tmp_path, capsys):
    files = []
    for i in range(6):
        times, places = reach(way=WAY + np.random.default_rng(i).normal(0.0, 0.02, 3))
        closing = share((times - REST - 0.7 * DURATION) / 0.3)
        files.append(write(tmp_path / f"d{i}.csv", "t,x,y,z,closing", [times, *places.T, closing]))
    bowed = reach()[1] + np.outer(np.sin(np.pi * share((reach()[0] - REST) / DURATION)), [0.0, 0.25, 0.0])
    files.append(write(tmp_path / "odd.csv", "t,x,y,z", [reach()[0], *bowed.T]))
    folder, library = tmp_path / "demonstrations", tmp_path / "mine.xml"
    assert answer(capsys, "dmp", "import", *files, "--out", folder)[0] == 0
    taught = ("dmp", "train", *sorted(folder.iterdir()), "--id", "mine", "-o", library)
    status, data = answer(capsys, *taught)
    assert status == 0 and data["strange"] == ["odd"] and data["verdict"] == "reached"
    assert (tmp_path / "mine.png").stat().st_size > 10_000
    assert load_library(library).ids() == ["mine"]
    beside = load_beside(library)["mine"]
    assert "0.00 to 1.00" in beside["fingers"] and len(beside["from"]) == 7
    before = library.read_bytes()
    assert answer(capsys, *taught)[0] == 2 and library.read_bytes() == before, "the name is taken"
    assert answer(capsys, "dmp", "validate", library)[0] == 0
    assert answer(capsys, "dmp", "validate", library, "--needed", "1")[0] == 1
    assert answer(capsys, "dmp", "inspect", library, "--id", "none")[0] == 1
    out = tmp_path / "path.csv"
    assert answer(capsys, "dmp", "export", library, "--id", "mine", "-o", out)[0] == 0
    assert read(out).way == pytest.approx(data["demonstrations"][0]["way_m"], abs=0.05)


class LateRobot:
    """A guided arm, measured every 5 ms, whose measurements arrive in bursts every 0.1 s."""

    state = SimpleNamespace(state="waits", holding="", actions=("receive",), fingers=())
    arm = SimpleNamespace(guided=nullcontext)
    time = 100.0

    def pause(self, seconds):
        self.time += seconds

    def seen(self, name):
        measured = 0.1 * np.floor(self.time / 0.1)
        times, places = reach()
        place = [np.interp(measured - 100.0, times, column) for column in places.T]
        return SimpleNamespace(
            position=np.array(place), orientation=np.array([0.0, 0.0, 0.0, 1.0])
        ), self.time - measured


def test_each_sample_of_a_guided_arm_has_its_measurement_time():
    recorded = record(LateRobot(), "a")
    assert follows(recorded, *reach())


class Leads:
    """A hand that pulls the palm of a World with a spring: `at(t)` is its place (m), t in s since `begin`."""

    def __init__(self, world, at, begin):
        self.at, self.begin, self.last = at, begin, None
        world.after_period.append(self)

    def __call__(self, world):
        if world.robot.state.can_move is False:
            return
        t, palm = world.time - self.begin, world.robot.arm.palm.position
        speed = np.zeros(3) if self.last is None else (palm - self.last) / 0.005
        self.last = palm
        wanted = (self.at(t) - self.at(t - 0.005)) / 0.005
        force = 600.0 * (self.at(t) - palm) + 200.0 * (wanted - speed)
        world.push(force * min(1.0, 40.0 / max(1e-9, float(np.linalg.norm(force)))), 0.02)


def test_a_motion_taught_by_hand_guiding_is_repeated_within_2_mm(tmp_path):
    library = tmp_path / "taught.xml"
    with coglab.World(seed=1, person="accustomed", perfect_perception=True) as world:
        start = world.robot.arm.palm.position.copy()

        def way(t):
            u = np.clip((t - 0.5) / 2.5, 0.0, 1.0)
            return start + share(u) * np.array([0.12, 0.25, -0.12]) + np.array([0, 0, 0.06]) * 64 * (u * (1 - u)) ** 3

        Leads(world, way, world.time)
        recorded = record(world.robot, "taught")
        world.after_period.clear()
        left = world.robot.arm.palm.position
        world.step(0.5)
        assert np.linalg.norm(world.robot.arm.palm.position - left) < 0.005, "the arm stands in place"
        assert world.robot.state.can_move and "receive" in world.robot.state.actions, "the brain waits in its hub"
    demonstration = cut.reaches(recorded)[0]
    taught = train("taught", [demonstration], mapping="none")
    add_to_library(taught, library)
    shipped = load_library(library)
    shipped.load(str(coglab.robot.LIBRARY))
    shipped.save(str(library))
    with coglab.World(seed=1, settings={"dmp_library": str(library)}) as world:
        palm = []
        world.after_period.append(lambda w: palm.append(w.robot.arm.palm.position))
        assert world.robot.arm.reach("taught", demonstration.positions[-1]).ok
    shares = np.linspace(0.0, 1.0, 2000)
    path = np.column_stack(
        [np.interp(shares, demonstration.times / demonstration.duration, c) for c in demonstration.positions.T]
    )
    away = [np.linalg.norm(path - p, axis=1).min() for p in palm]
    assert max(away) < 0.002
    assert np.linalg.norm(palm[-1] - demonstration.positions[-1]) < 0.002


def test_recording_without_a_robot_names_the_next_step(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("COGLAB_TOP", raising=False)
    with ThreadPoolExecutor() as pool:  # also in a thread without signal handlers
        record = ("dmp", "record", "a", "--out", tmp_path, "--master", "http://127.0.0.1:9")
        status, data = pool.submit(answer, capsys, *record).result(60)
    assert status == NotThere.status and "robot" in data["error"] and not list(tmp_path.iterdir())
