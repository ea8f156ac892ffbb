"""Recordings of people: the formats of two data sets, playing with recording:=, and learning from them."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from coglab_perception.recogniser import Recogniser, load_patterns
from coglab_py.packages import package_path
from coglab_sim.person.recorded_motion import RecordingError
from coglab_sim.person.recorded_person import open_recorded_hand
from coglab_tools.__main__ import run
from coglab_tools.command import CheckFailed, NotThere
from coglab_tools.dmp.train import load_library
from coglab_tools.people.dexycb import WRIST, read_dexycb
from coglab_tools.people.handover import MEETING, write_recording
from coglab_tools.people.kth import read_kth
from coglab_tools.people.learn import learn_patterns, learn_primitives, recorded_demonstrations
from scipy.spatial.transform import Rotation

SAMPLE = Path(__file__).resolve().parents[4].parent / "shared" / "data" / "kth_handover_sample"
needs_sample = pytest.mark.skipif(
    not SAMPLE.is_dir(), reason=f"the recorded handover of the KTH dataset is not at {SAMPLE}; it is not shipped"
)


def share(u):
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


@pytest.fixture
def folder(tmp_path):
    """A made-up handover in the form of the KTH dataset: the giver at -x, the taker at +x, a touch after 2.6 s."""
    times = np.arange(600) / 120.0
    there, back = share((times - 1.0) / 1.5), share((times - 3.0) / 1.5)
    tilt = Rotation.from_euler("y", 0.5 * there).as_quat()

    def pose(name, places, turns=None):
        turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1)) if turns is None else turns
        rows = np.column_stack([np.broadcast_to(places, (len(times), 3)), turns])
        np.savetxt(folder / f"{name}_pose_saved.csv", rows, delimiter=",", header="x,y,z,q0,q1,q2,q3", comments="")

    folder = tmp_path / "made_up"
    folder.mkdir()
    for role, side in (("giver", -1.0), ("taker", 1.0)):
        pose(f"{role}_chest", [side * 0.6, 0.0, 1.1])
        pose(f"{role}_LHand", [side * 0.5, side * 0.2, 0.8])
        way = np.outer(there - back, [-side * 0.4, 0.05, 0.25])
        pose(f"{role}_RHand", np.array([side * 0.45, -side * 0.1, 0.8]) + way, tilt)
        grip = np.where(times < 2.9 if role == "giver" else times > 2.6, 9.0, 0.0)
        forces = np.column_stack([np.zeros((len(times), 2)), grip, np.zeros((len(times), 3))])
        np.savetxt(folder / f"Wrench_{role}_saved.csv", forces, delimiter=",", header="Fx,Fy,Fz,Tx,Ty,Tz", comments="")
        if role == "giver":
            pose("baton", np.array([-0.4, 0.1, 0.75]) + way)
    return folder


def test_a_handover_in_the_robots_world_plays(folder, tmp_path):
    handover = read_kth(folder)
    assert handover.touch == pytest.approx(2.6, abs=0.02)
    for role in ("giver", "taker"):
        assert handover.reach(role).way == pytest.approx(np.linalg.norm([0.4, 0.05, 0.25]), abs=0.01)
        file = tmp_path / f"{role}.csv"
        write_recording(file, handover.recording(role))
        hand, _ = open_recorded_hand({"file": str(file), "object": "in_hand"}, "object_mug")
        end = hand.at(hand.arrived)
        assert np.linalg.norm(end.position - MEETING) < 0.02, "it ends at the place of handovers"
        assert hand.at(0.0).position[0] > MEETING[0] + 0.3, "from the person's side"
        assert end.rotation.magnitude() < 0.05
    with pytest.raises(RecordingError, match="'object_mug'"):
        open_recorded_hand({"file": str(file)}, "object_mug")
    write_recording(file, handover.recording("giver", "object_mug"))
    assert open_recorded_hand({"file": str(file)}, "object_mug")[0].object_in_hand is not None


def test_lost_samples_within_a_reach_are_bridged(folder):
    path = folder / "giver_RHand_pose_saved.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[200:206] = [lines[200]] * 6
    lines[206:210] = ["nan,nan,nan,0,0,0,1"] * 4
    path.write_text("\n".join(lines), encoding="utf-8")
    handover = read_kth(folder)
    assert handover.reach("giver").way == pytest.approx(np.linalg.norm([0.4, 0.05, 0.25]), abs=0.01)
    assert any("4 of 600" in note for note in handover.notes)


def test_without_forces_the_motion_back_is_not_the_reach(folder):
    reach = read_kth(folder).span("giver")
    (folder / "Wrench_taker_saved.csv").unlink()
    assert read_kth(folder).span("giver") == reach


def test_an_unusable_folder_is_refused_with_the_file(folder):
    (folder / "giver_RHand_pose_saved.csv").write_text("x,y,z,q0,q1,q2,q3\n1,2\n", encoding="utf-8")
    with pytest.raises(CheckFailed, match=r"giver_RHand_pose_saved\.csv:2: .*\b7\b.*\b2\b"):
        read_kth(folder)
    (folder / "giver_RHand_pose_saved.csv").unlink()
    with pytest.raises(NotThere, match=r"giver_RHand_pose_saved\.csv"):
        read_kth(folder)


@pytest.fixture
def dexycb(tmp_path):
    """A made-up sequence in DexYCB's form and in that of HandoverSim's cache, and the true wrist in the tag's frame."""
    times = np.arange(90) / 30.0
    s = share((times - 0.8) / 1.2)
    wrist = np.array([0.3, 0.2, 0.1]) + np.outer(s, [-0.35, -0.1, 0.25])
    turns = Rotation.from_euler("z", 0.7 * s) * Rotation.from_euler("x", 0.4)
    tag = Rotation.from_euler("xyz", [2.1, 0.3, -0.4])
    origin = np.array([0.1, -0.2, 0.9])
    sequence = tmp_path / "20200709-subject-01" / "20200709_141754"
    sequence.mkdir(parents=True)
    calibration = tmp_path / "calibration" / "extrinsics_a"
    calibration.mkdir(parents=True)
    rows = np.column_stack([tag.as_matrix(), origin]).ravel().tolist()
    (calibration / "extrinsics.yml").write_text(yaml.safe_dump({"extrinsics": {"apriltag": rows}}), encoding="utf-8")
    meta = {"mano_sides": ["right"], "ycb_grasp_ind": 1, "extrinsics": "a", "ycb_ids": [2, 14]}
    (sequence / "meta.yml").write_text(yaml.safe_dump(meta), encoding="utf-8")
    hand = np.zeros((90, 1, 51))
    hand[:, 0, :3] = (tag * turns).as_rotvec()
    hand[:, 0, 48:] = tag.apply(wrist) + origin - WRIST["right"]
    hand[:6] = 0.0
    things = np.zeros((90, 2, 7))
    things[..., 3] = 1.0
    np.savez(sequence / "pose.npz", pose_m=hand, pose_y=things)

    fine = np.arange(3000) / 1000.0
    dense = Rotation.from_euler("z", 0.7 * share((fine - 0.8) / 1.2)) * Rotation.from_euler("x", 0.4)
    path = np.array([0.3, 0.2, 0.1]) + np.outer(share((fine - 0.8) / 1.2), [-0.35, -0.1, 0.25])
    cached = np.zeros((3000, 1, 51))
    cached[:, 0, :3] = path - dense.apply(WRIST["right"])
    cached[:, 0, 3:6] = dense.as_euler("XYZ")
    np.savez(tmp_path / "pose_007.npz", pose_m=cached, pose_y=np.zeros((3000, 2, 6)))
    (tmp_path / "meta_007.json").write_text(json.dumps(meta), encoding="utf-8")
    return sequence / "pose.npz", tmp_path / "pose_007.npz", wrist


def test_dexycb_and_its_cache_have_the_same_wrist(dexycb):
    raw, cache, wrist = dexycb
    for path in (raw, cache):
        hand = read_dexycb(path).hands["giver"]
        true = np.column_stack([np.interp(hand.times, np.arange(90) / 30.0, column) for column in wrist.T])
        assert np.abs(hand.positions - true).max() < 0.002
    reach = read_dexycb(raw).reach("giver")
    assert reach.way == pytest.approx(np.linalg.norm([0.35, 0.1, 0.25]), abs=0.01)
    assert np.linalg.norm(read_dexycb(cache).recording()["human_hand"].positions[-1] - MEETING) < 0.02
    (raw.parents[2] / "calibration" / "extrinsics_a" / "extrinsics.yml").unlink()
    with pytest.raises(NotThere, match="vertical"):
        read_dexycb(raw)


def test_learnt_files_name_their_sources(folder, tmp_path, capsys):
    primitives, patterns = tmp_path / "p.xml", tmp_path / "p.json"
    assert run(["people", "learn", str(folder), "--primitives", str(primitives), "--patterns", str(patterns)]) == 0
    library = load_library(primitives)
    assert {"reach_human", "reach_human_left", "give_human", "take_board"} <= set(library.ids())
    assert "learnt from 1" in library["give_human"].description
    assert "KTH-RPL" in json.loads(patterns.read_text(encoding="utf-8"))["source"]
    fresh = recorded_demonstrations([read_kth(folder).reach("giver")], 20, seed=7)
    right = 0
    for name, sights in fresh.items():
        for stamps, positions in sights:
            recogniser = Recogniser(*load_patterns(str(patterns)))
            decided = {
                e.pattern for t, p in zip(stamps, positions, strict=True) if (e := recogniser.update(t, p)).decided
            }
            right += decided == {name}
    assert right >= 72, "of 80"


def test_a_recorded_giver_teaches_only_giving(dexycb, tmp_path, capsys):
    assert run(["people", "learn", str(dexycb[1]), "--primitives", str(tmp_path / "p.xml")]) == 0
    library = load_library(tmp_path / "p.xml")
    assert "learnt from 1" in library["give_human"].description
    assert "learnt" not in library["reach_human"].description and "reach_human_left" not in library.ids()
    assert "reach_human_left, reach_human_right" in capsys.readouterr().out


@needs_sample
def test_shipped_recorded_primitives_are_those_of_the_sample(tmp_path):
    """Their weights can be learnt again from the recording, which is not shipped."""
    handover = read_kth(SAMPLE)
    shipped = load_library(package_path("coglab_controllers", "config", "primitives_recorded.xml"))
    again = learn_primitives([handover])
    for name in again.ids():
        assert np.allclose(again[name].weights, shipped[name].weights, atol=1e-6), name
    assert np.max(np.abs(handover.reach("taker").speed)) == pytest.approx(0.70, abs=0.02)
    counts = learn_patterns([handover], tmp_path / "p.json")
    assert set(counts) == {"centre", "high", "left", "right"}
