"""The edges of what a recording may be and how it is played: counts of samples, both ends, waiting, defaults."""

from dataclasses import fields
from itertools import groupby

import numpy as np
import pytest
from coglab_py.pose import Pose, about_z
from coglab_sim.person import recorded_motion
from coglab_sim.person.recorded_motion import (
    Playback,
    PlaybackSettings,
    Recording,
    RecordingError,
    Track,
    load_recording,
)

ROWS = "".join(f"{0.5 * i},{i},0,0\n" for i in range(5))


def test_settings_are_those_that_are_documented():
    shipped = {"file": "", "frame": "human_hand", "rename": {}, "time_scale": 1.0, "mirror": False, "turn_deg": 0.0}
    shipped |= {"end_at": None, "at_end": "hold", "wait_at": None, "wait_distance": 0.15, "wait_limit": 10.0}
    shipped |= {"allow_jumps": False}
    assert {field.name: getattr(PlaybackSettings(), field.name) for field in fields(PlaybackSettings)} == shipped


@pytest.mark.parametrize(
    "settings, words",
    [
        ({"time_scale": 0.0}, "time_scale must be above 0, got 0.0"),
        ({"time_scale": -1.0}, "time_scale must be above 0"),
        ({"time_scale": float("inf")}, "time_scale must be above 0"),
        ({"end_at": (1.0, 2.0)}, "end_at needs three finite numbers"),
        ({"end_at": (1.0, 2.0, float("nan"))}, "end_at needs three finite numbers"),
        ({"wait_distance": 0.0}, "wait_distance must be above 0 m and wait_limit not negative"),
        ({"wait_limit": -0.1}, "wait_distance must be above 0 m and wait_limit not negative"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(settings, words):
    with pytest.raises(RecordingError, match=words):
        PlaybackSettings(**settings)
    PlaybackSettings(time_scale=0.01, wait_distance=0.01, wait_limit=0.0, end_at=(0.0, 0.0, 0.0))
    assert PlaybackSettings.from_mapping({"end_at": [1, 2, 3], "at_end": "loop"}).end_at == (1, 2, 3)


def in_csv(tmp_path, text):
    path = tmp_path / "r.csv"
    path.write_text(text)
    return str(path)


def test_as_many_samples_as_are_read_are_accepted_and_not_one_more(tmp_path, monkeypatch):
    path, npz = in_csv(tmp_path, "t,x,y,z\n" + ROWS), str(tmp_path / "r.npz")
    np.savez(npz, t=np.arange(5.0), position=np.zeros((5, 3)))
    for most, refused in ((5, False), (4, True)):
        monkeypatch.setattr(recorded_motion, "MOST_SAMPLES", most)
        for file, words in ((path, "more than 4 samples"), (npz, "'t' has 5 samples, expected 1..4")):
            if refused:
                with pytest.raises(RecordingError, match=words):
                    load_recording(file)
            else:
                assert len(load_recording(file).tracks["human_hand"].stamps) == 5
    np.savez(npz, t=np.zeros(0), position=np.zeros((0, 3)))
    with pytest.raises(RecordingError, match="'t' has 0 samples, expected 1.."):
        load_recording(npz)


def test_arrays_that_do_not_belong_together_are_refused(tmp_path):
    path = str(tmp_path / "r.npz")
    for arrays in (
        {"t": np.arange(3.0)},
        {"t": np.zeros((3, 1)), "position": np.zeros((3, 3))},
        {"t": np.arange(3.0), "position": np.zeros((3, 3)), "orientation": np.zeros((2, 4))},
        {"t": np.arange(3.0), "position": np.zeros((3, 4))},
    ):
        np.savez(path, **arrays)
        with pytest.raises(RecordingError, match="'t' needs 'position' of shape"):
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


def test_time_begins_with_the_first_sample_of_any_frame(tmp_path):
    path = in_csv(tmp_path, "t,x,y,z,frame\n5,0,0,0,\n6,1,0,0,\n4,7,0,0,b\n9,8,0,0,b\n")
    recording = load_recording(path, frame="own")
    assert list(recording.tracks) == ["own", "b"] and recording.duration == 5.0
    assert recording.tracks["own"].stamps.tolist() == [1.0, 2.0] and recording.tracks["b"].stamps[0] == 0.0
    partly = in_csv(tmp_path, "t,x,y,z,qx,qy,qz\n0,0,0,0,1,0,0\n1,0,0,0,1,0,0\n")
    assert load_recording(partly).tracks["human_hand"].orientations[0] == pytest.approx([0, 0, 0, 1])
    upper = tmp_path / "R.CSV"
    upper.write_text("t,x,y,z\n" + ROWS)
    assert load_recording(str(upper)).duration == 2.0


def test_a_bag_has_its_frames_in_order_whatever_slashes_they_carry(tmp_path):
    import rosbag
    import rospy
    from geometry_msgs.msg import TransformStamped
    from tf2_msgs.msg import TFMessage

    path = str(tmp_path / "r.bag")
    with rosbag.Bag(path, "w") as bag:
        for topic, stamp, x in (("/tf", 3.0, 3.0), ("/tf", 2.0, 2.0), ("/other", 1.0, 1.0)):
            item = TransformStamped()
            item.header.stamp, item.header.frame_id = rospy.Time.from_sec(stamp), "/world"
            item.child_frame_id = "/human_hand"
            item.transform.translation.x, item.transform.rotation.w = x, 1.0
            bag.write(topic, TFMessage([item]), rospy.Time.from_sec(5.0))
    track = load_recording(path).tracks["human_hand"]
    assert track.stamps.tolist() == [0.0, 1.0] and track.positions[:, 0].tolist() == [2.0, 3.0]
    with pytest.raises(RecordingError, match="no transforms from 'map' on /tf; parents seen: world"):
        load_recording(path, world="map")
    with pytest.raises(RecordingError, match="no transforms from 'world' on /none; parents seen: none"):
        load_recording(path, topic="/none")
    assert load_recording(path, topic="/other").duration == 0.0


def line(seconds=4.0, step=0.5):
    """x is the time."""
    stamps = np.arange(0.0, seconds + step / 2, step)
    places = np.column_stack([stamps, 0.1 * stamps, np.zeros(len(stamps))])
    return Track(stamps, places, np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1)))


def playing(**settings):
    return Playback(Recording({"human_hand": line()}), PlaybackSettings(**settings))


def x_at(play, now, robot=None):
    return play.frames(now, robot)["human_hand"].position[0]


def test_a_track_is_interpolated_and_its_ends_are_held():
    track = line()
    for t, x in ((-1.0, 0.0), (0.0, 0.0), (0.2, 0.2), (0.5, 0.5), (3.9, 3.9), (4.0, 4.0), (9.0, 4.0)):
        assert track.at(t).position == pytest.approx([x, 0.1 * x, 0.0]), t
    one = Track(np.array([0.0]), np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, 0.0, 1.0]]))
    assert one.at(0.0).position == pytest.approx([1.0, 2.0, 3.0])
    turned = Track(np.array([0.0, 2.0]), np.zeros((2, 3)), np.array([about_z(0.2), about_z(1.2)]))
    assert turned.at(0.5).rotation.as_rotvec() == pytest.approx([0.0, 0.0, 0.45])


def test_time_runs_from_the_first_look_on_and_never_back():
    play = playing()
    assert x_at(play, 100.0) == 0.0 and x_at(play, 101.0) == pytest.approx(1.0)
    assert x_at(play, 100.5) == pytest.approx(1.0) and x_at(play, 101.5) == pytest.approx(2.0)
    slow = playing(time_scale=4.0)
    x_at(slow, 0.0)
    assert x_at(slow, 4.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "at_end, after", [("hold", [4.0, 4.0, 4.0]), ("loop", [4.0, 0.5, 1.5]), ("vanish", [4.0, None, None])]
)
def test_at_the_end(at_end, after):
    play = playing(at_end=at_end)
    play.frames(0.0)
    for now, x in zip((4.0, 4.5, 5.5), after, strict=True):
        frames = play.frames(now)
        assert frames == {} if x is None else frames["human_hand"].position[0] == pytest.approx(x)
    single = Playback(Recording({"a": Track(np.zeros(1), np.zeros((1, 3)), np.array([[0, 0, 0, 1.0]]))}))
    assert single.frames(0.0)["a"].position == pytest.approx(np.zeros(3))
    assert list(single.frames(7.0)) == ["a"] and single.settings.at_end == "hold"


@pytest.mark.parametrize("away, waits", [(0.149, False), (0.151, True)])
def test_it_waits_until_the_robots_hand_is_near(away, waits):
    """At 1 s of the recording, where its hand is at x = 1."""
    play = playing(wait_at=1.0, wait_limit=3.0)
    robot = Pose(np.array([1.0, 0.1 - away, 0.0]))
    x_at(play, 0.0, robot)
    x_at(play, 1.0, robot)
    assert x_at(play, 1.5, robot) == pytest.approx(1.0 if waits else 1.5)
    if waits:
        assert x_at(play, 3.9, robot) == pytest.approx(1.0)
        assert x_at(play, 4.1, robot) == pytest.approx(1.2), "it has waited 3 s"


def test_without_a_robot_it_waits_and_every_loop_waits_anew():
    play = playing(wait_at=1.0, wait_limit=2.0, at_end="loop")
    seen = [x_at(play, 0.25 * i) for i in range(60)]
    waits = [len(list(same)) for x, same in groupby(seen) if x == 1.0]
    assert len(waits) >= 2 and waits[0] == waits[1] == 8, "2 s each time"
    assert playing(wait_at=None).settings.wait_at is None
    begin = playing(wait_at=0.0, wait_limit=1.0)
    assert [x_at(begin, t) for t in (0.0, 0.5, 0.9, 1.5)] == pytest.approx([0.0, 0.0, 0.0, 0.6])


def test_mirror_turn_and_end_place_every_frame():
    tracks = {"human_hand": line(), "b": line()}
    play = Playback(Recording(tracks), PlaybackSettings(mirror=True, turn_deg=90.0, end_at=(1.0, 2.0, 3.0)))
    # Mirrored (4, -0.4, 0), turned (0.4, 4, 0), and that ends at (1, 2, 3).
    for name in ("human_hand", "b"):
        assert play.at(name, 4.0).position == pytest.approx([1.0, 2.0, 3.0])
        assert play.at(name, 0.0).position == pytest.approx([0.6, -2.0, 3.0])
        assert play.at(name, 0.0).rotation.as_rotvec() == pytest.approx([0.0, 0.0, np.pi / 2])
    tilted = Track(np.zeros(1), np.zeros((1, 3)), np.array([[0.5, 0.1, 0.3, np.sqrt(1 - 0.35)]]))
    mirrored = Playback(Recording({"a": tilted}), PlaybackSettings(mirror=True)).at("a", 0.0)
    before = Pose(np.zeros(3), tilted.orientations[0])
    flip = np.diag([1.0, -1.0, 1.0])
    assert mirrored.rotation.as_matrix() == pytest.approx(flip @ before.rotation.as_matrix() @ flip)


def test_frames_are_renamed_and_chosen_under_their_new_names(tmp_path):
    path = in_csv(tmp_path, "t,x,y,z,frame\n0,0,0,0,a\n1,1,0,0,a\n0,5,0,0,b\n")
    play = Playback.open(PlaybackSettings(file=path, rename={"a": "c"}), wanted=lambda name: name == "c")
    assert list(play.names) == ["c"] and play.first == "c"
    with pytest.raises(RecordingError, match=r"none of its frames \(a, b\) is one that perception shows; see rename"):
        Playback.open(PlaybackSettings(file=path), wanted=lambda name: name == "c")
    assert sorted(Playback.open(PlaybackSettings(file=path)).names) == ["a", "b"]
