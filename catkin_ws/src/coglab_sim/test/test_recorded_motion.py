"""Recorded motion: CSV, npz and bag give the same data; placing, time, waiting, ends; errors name bad files."""

from __future__ import annotations

import numpy as np
import pytest
from coglab_perception.frames import FrameNames
from coglab_py.pose import Pose, about_z
from coglab_sim.person.recorded_motion import (
    Playback,
    PlaybackSettings,
    Recording,
    RecordingError,
    Track,
    load_recording,
)

STAMPS = 100.0 + np.arange(0.0, 1.01, 0.1)
POSITIONS = np.column_stack([1.3 - 0.4 * (STAMPS - 100.0), 0.2 + 0.1 * (STAMPS - 100.0), 0.15 + 0.3 * (STAMPS - 100.0)])
TURNS = np.array([about_z(0.5 * (t - 100.0)) for t in STAMPS])


def write_csv(path, frames=("",)):
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("t,x,y,z,qx,qy,qz,qw" + (",frame" if frames != ("",) else "") + "\n")
        for t, p, q in zip(STAMPS, POSITIONS, TURNS, strict=True):
            for name in frames:
                numbers = ",".join(repr(float(v)) for v in (t, *p, *q))
                stream.write(numbers + (f",{name}" if name else "") + "\n")
    return str(path)


def write_npz(path, prefix=""):
    np.savez(path, **{f"{prefix}t": STAMPS, f"{prefix}position": POSITIONS, f"{prefix}orientation": TURNS})
    return str(path)


def write_bag(path, world="world", frames=("human_hand",)):
    import rosbag
    import rospy
    from geometry_msgs.msg import TransformStamped
    from tf2_msgs.msg import TFMessage

    with rosbag.Bag(str(path), "w") as bag:
        for t, p, q in zip(STAMPS, POSITIONS, TURNS, strict=True):
            message = TFMessage()
            for name in frames:
                item = TransformStamped()
                item.header.stamp, item.header.frame_id = rospy.Time.from_sec(float(t)), world
                item.child_frame_id = name
                place, turn = item.transform.translation, item.transform.rotation
                place.x, place.y, place.z = p
                turn.x, turn.y, turn.z, turn.w = q
                message.transforms.append(item)
            bag.write("/tf", message, rospy.Time.from_sec(float(t)))
            if t == STAMPS[3]:
                bag.write("/tf", message, rospy.Time.from_sec(float(t)))  # tf repeats itself
    return str(path)


WRITERS = {"csv": write_csv, "npz": write_npz, "bag": write_bag}


@pytest.mark.parametrize("kind", WRITERS)
def test_every_kind_of_file_says_the_same(tmp_path, kind):
    recording = load_recording(WRITERS[kind](tmp_path / f"reach.{kind}"))
    assert list(recording.tracks) == ["human_hand"]
    assert recording.duration == pytest.approx(1.0)
    track = recording.tracks["human_hand"]
    assert track.stamps[0] == 0.0
    frame = track.at(0.55)
    assert frame.position == pytest.approx([1.08, 0.255, 0.315])
    assert frame.axis(0) == pytest.approx([np.cos(0.275), np.sin(0.275), 0.0], abs=1e-6)
    assert track.at(-5.0).position == pytest.approx(POSITIONS[0])
    assert track.at(np.inf).position == pytest.approx(POSITIONS[-1])


def test_several_frames_in_one_file(tmp_path):
    frames = ("human_hand", "object_mug")
    for path in (write_csv(tmp_path / "two.csv", frames), write_bag(tmp_path / "two.bag", frames=frames)):
        assert sorted(load_recording(path).tracks) == sorted(frames)
    assert list(load_recording(write_npz(tmp_path / "o.npz", "object_mug.")).tracks) == ["object_mug"]


def test_a_csv_without_orientation(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("t, x, y, z\n0,1,2,3\n1,1,2,4\n")
    frame = load_recording(str(path), "object_mug").tracks["object_mug"].at(0.5)
    assert frame.position == pytest.approx([1, 2, 3.5])
    assert frame.orientation == pytest.approx([0, 0, 0, 1])


def playback(tmp_path, **settings):
    return Playback.open(PlaybackSettings(file=write_csv(tmp_path / "reach.csv"), **settings))


def test_time_scale_and_the_ends(tmp_path):
    play = playback(tmp_path, time_scale=2.0)
    play.frames(50.0)
    assert play.frames(51.0)["human_hand"].position == pytest.approx(POSITIONS[5])
    assert play.frames(60.0)["human_hand"].position == pytest.approx(POSITIONS[-1])
    vanishing = playback(tmp_path, at_end="vanish")
    vanishing.frames(0.0)
    assert vanishing.frames(1.0) and vanishing.frames(1.1) == {}
    looping = playback(tmp_path, at_end="loop")
    looping.frames(0.0)
    assert looping.frames(1.3)["human_hand"].position == pytest.approx(POSITIONS[3])


def test_mirror_turn_and_anchor(tmp_path):
    mirrored = playback(tmp_path, mirror=True).frames(0.0)["human_hand"]
    assert mirrored.position == pytest.approx(POSITIONS[0] * [1, -1, 1])
    play = playback(tmp_path, mirror=True)
    play.frames(0.0)
    assert play.frames(1.0)["human_hand"].axis(0) == pytest.approx([np.cos(0.5), -np.sin(0.5), 0.0])
    turned = playback(tmp_path, turn_deg=90.0).frames(0.0)["human_hand"]
    assert turned.position == pytest.approx([-0.2, 1.3, 0.15])
    anchored = playback(tmp_path, end_at=(0.8, 0.0, 0.4))
    anchored.frames(0.0)
    assert anchored.frames(9.0)["human_hand"].position == pytest.approx([0.8, 0.0, 0.4])
    assert anchored.recording.tracks["human_hand"].at(9.0).position == pytest.approx(POSITIONS[-1])


def test_of_a_bag_only_what_a_tracker_sees(tmp_path):
    names = FrameNames("world", "human_hand", "board", "object_{id}")
    path = write_bag(tmp_path / "all.bag", frames=("human_hand", "object_mug", "dmp_goal", "board"))
    play = Playback.open(PlaybackSettings(file=path), "world", names.is_tracked)
    assert sorted(play.names) == ["human_hand", "object_mug"]
    renamed = PlaybackSettings(file=path, rename={"dmp_goal": "object_ball"})
    assert "object_ball" in Playback.open(renamed, "world", names.is_tracked).names
    path = write_bag(tmp_path / "none.bag", frames=("dmp_goal", "object_"))
    with pytest.raises(RecordingError, match="object_"):
        Playback.open(PlaybackSettings(file=path), "world", names.is_tracked)


def test_the_recorded_hand_waits_for_the_robot(tmp_path):
    far, near = Pose(np.array([0.2, 0.0, 0.4])), Pose(POSITIONS[5] + [0.1, 0.0, 0.0])
    play = playback(tmp_path, wait_at=0.5, wait_limit=3.0)
    for k in range(20):
        frames = play.frames(0.1 * k, far)
    assert frames["human_hand"].position == pytest.approx(POSITIONS[5])
    play.frames(2.0, near)
    assert play.frames(2.1, near)["human_hand"].position == pytest.approx(POSITIONS[7])
    patient = playback(tmp_path, wait_at=0.5, wait_limit=1.0)
    for k in range(30):
        frames = patient.frames(0.1 * k, far)
    assert frames["human_hand"].position == pytest.approx(POSITIONS[-1]), "not for ever"


class Bomb:
    """Unpickling it would raise."""

    def __reduce__(self):
        return exec, ("raise SystemExit('executed')",)


def test_bad_npz_files_are_named(tmp_path):
    path = tmp_path / "bad.npz"
    path.write_bytes(b"nonsense")
    with pytest.raises(RecordingError, match="npz"):
        load_recording(str(path))
    np.savez(path, t=np.array([Bomb()], dtype=object), position=np.zeros((1, 3)))
    with pytest.raises(RecordingError, match="npz"):
        load_recording(str(path))
    np.savez(path, time=STAMPS)
    with pytest.raises(RecordingError, match="'t'.* time"):
        load_recording(str(path))


def test_bad_bags_are_named(tmp_path):
    path = tmp_path / "bad.bag"
    path.write_bytes(b"#ROSBAG V2.0\n but then nonsense")
    with pytest.raises(RecordingError, match="bad.bag"):
        load_recording(str(path))
    with pytest.raises(RecordingError, match="'world'.* map"):
        load_recording(write_bag(tmp_path / "map.bag", world="map"))


def test_bad_names_and_settings(tmp_path):
    with pytest.raises(RecordingError, match=r"'\.txt'"):
        load_recording("reach.txt")
    with pytest.raises(RecordingError, match="none.csv"):
        load_recording(str(tmp_path / "none.csv"))
    for fault, words in (
        ({"speed": 2}, "unknown fields speed"),
        ({"time_scale": 0}, "time_scale"),
        ({"at_end": "stop"}, "hold, loop or vanish"),
        ({"end_at": [1, 2]}, "three finite numbers"),
        ({"wait_distance": 0}, "wait_distance"),
    ):
        with pytest.raises(RecordingError, match=words):
            PlaybackSettings.from_mapping(fault)


def test_a_track_that_jumps_is_refused_unless_allowed(tmp_path) -> None:
    file = tmp_path / "jump.csv"
    file.write_text("t,x,y,z\n0,0,0,0\n0.1,0.05,0,0\n0.11,0.4,0,0\n0.2,0.4,0,0\n")
    with pytest.raises(RecordingError, match="human_hand.*jumps"):
        Playback.open(PlaybackSettings(file=str(file)))
    assert list(Playback.open(PlaybackSettings(file=str(file), allow_jumps=True)).names) == ["human_hand"]


ROWS = "".join(f"{0.5 * i},{i},0,0\n" for i in range(5))


def in_csv(tmp_path, text):
    path = tmp_path / "r.csv"
    path.write_text(text)
    return str(path)


def test_arrays_that_do_not_belong_together_are_refused(tmp_path):
    path = str(tmp_path / "r.npz")
    for arrays in (
        {"t": np.arange(3.0)},
        {"t": np.zeros((3, 1)), "position": np.zeros((3, 3))},
        {"t": np.arange(3.0), "position": np.zeros((3, 3)), "orientation": np.zeros((2, 4))},
        {"t": np.arange(3.0), "position": np.zeros((3, 4))},
    ):
        np.savez(path, **arrays)
        with pytest.raises(RecordingError, match="'position'"):
            load_recording(path)
    np.savez(path, **{"a.t": np.arange(2.0), "a.position": np.ones((2, 3)), "other": np.zeros(9)})
    recording = load_recording(path)
    assert list(recording.tracks) == ["a"] and recording.tracks["a"].at(0.5).position == pytest.approx(np.ones(3))


def test_faults_name_the_sample(tmp_path):
    quaternion = "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,{}\n"
    for text, words in (
        ("t,x,y,z\n" + ROWS.replace("1.0,2,0,0", "1.0,2,inf,0"), "sample 3 is not finite"),
        ("t,x,y,z\n0,0,0,0\n2,0,0,0\n1,0,0,0\n3,0,0,0\n", "time must increase, sample 3 does not"),
        (quaternion.format(1.06), "sample 2 has a quaternion of length 1.06, expected 1"),
        (quaternion.format(0.94), "sample 2 has a quaternion of length 0.94"),
        ("t,x,y,z\n0,1,2,3\n0.5,1,,3\n", r":3: expected numbers for t,x,y,z, got \['0.5', '1', '', '3'\]"),
        ("t,x,z\n", "missing: y"),
    ):
        with pytest.raises(RecordingError, match=words):
            load_recording(in_csv(tmp_path, text))
    track = load_recording(in_csv(tmp_path, quaternion.format(1.04))).tracks["human_hand"]
    assert track.orientations[1] == pytest.approx([0, 0, 0, 1]), "what is nearly one is made one"


def line(seconds=4.0, step=0.5):
    """x is the time."""
    stamps = np.arange(0.0, seconds + step / 2, step)
    places = np.column_stack([stamps, 0.1 * stamps, np.zeros(len(stamps))])
    return Track(stamps, places, np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1)))


def playing(**settings):
    return Playback(Recording({"human_hand": line()}), PlaybackSettings(**settings))


def x_at(play, now, robot=None):
    return play.frames(now, robot)["human_hand"].position[0]


def test_time_runs_from_the_first_look_on_and_never_back():
    play = playing()
    assert x_at(play, 100.0) == 0.0 and x_at(play, 101.0) == pytest.approx(1.0)
    assert x_at(play, 100.5) == pytest.approx(1.0) and x_at(play, 101.5) == pytest.approx(2.0)
    slow = playing(time_scale=4.0)
    x_at(slow, 0.0)
    assert x_at(slow, 4.0) == pytest.approx(1.0)
