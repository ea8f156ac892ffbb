"""What the node makes of the robot's messages for the page, without a ROS master."""

from pathlib import Path

import pytest
from coglab_console.ros import view as ros_view
from coglab_console.scene.urdf_model import RobotModel
from coglab_msgs.msg import LwrState, MasterState, PredictedPath
from geometry_msgs.msg import Point, Pose

URDF = Path(__file__).resolve().parents[2] / "lwr_description" / "urdf" / "lwr_ih2.urdf"


class Subscriber:
    """One that is connected."""

    def __init__(self, *_arguments, **_options):
        pass

    def get_num_connections(self):
        return 1


@pytest.fixture
def seen(monkeypatch):
    """A view, the documents that it puts and the events that it says."""
    documents, events = {}, []
    monkeypatch.setattr(ros_view.rospy, "Subscriber", Subscriber)
    monkeypatch.setattr(ros_view.rospy, "get_time", lambda: 100.0)
    model = RobotModel(URDF.read_text())
    frames = {"human_hand": "human_hand", "board": "board"}
    found = ros_view.RosView(
        model, frames, lambda *words: events.append(words), documents.__setitem__, lambda *_: None, lambda _: None
    )
    found.listen()
    return found, documents, events


@pytest.mark.parametrize(
    "power, on", [(0x7F, True), (0xFF, True), (0xFFFF, True), (0x3F, False), (0x80, False), (0, False)]
)
def test_all_drives_are_on_where_each_joint_has_its_bit(seen, power, on):
    """Further bits of the word say something else."""
    view, _, _ = seen
    view._on_arm(LwrState(power=power))
    assert view.status()["arm"]["power"] is on


def test_each_time_the_robot_comes_to_stand_is_counted(seen):
    view, _, _ = seen
    view._on_machine(MasterState(state="/coglab_master/stopped", why="hold is latched"))
    assert view.stopped() == (True, "hold is latched", 1)
    view._on_machine(MasterState(state="/coglab_master/fault", why="no command mode"))
    assert view.stopped() == (True, "no command mode", 2)
    view._on_arm(LwrState(hold_latched=True))
    view._on_arm(LwrState(hold_latched=True))
    assert view.stopped()[2] == 3


def path_of(motion, *places):
    found = PredictedPath(motion=motion, times=[0.1 * i for i in range(len(places))])
    found.header.frame_id = "lwr_base_link"
    found.poses = [Pose(position=Point(*place)) for place in places]
    return found


def test_a_path_is_shown_until_its_own_controller_ends_it(seen):
    view, documents, _ = seen
    view._on_path(path_of("reach_human", (0.1, 0, 0.3), (0.4, 0, 0.3)), "dmp")
    assert view.path_runs() and documents["path"]["motion"] == "reach_human" and documents["path"]["kind"] == "running"
    view._on_path(path_of("", *[]), "ptp")
    assert view.path_runs() and documents["path"] is not None
    view._on_path(path_of("ptp 3", (0.4, 0, 0.3), (0.1, 0, 0.3)), "ptp")
    view._on_path(path_of("", *[]), "dmp")
    assert view.path_runs() and documents["path"]["motion"] == "ptp 3"
    view._on_path(path_of("", *[]), "ptp")
    assert not view.path_runs() and documents["path"] is None


def test_a_path_of_a_controller_that_fell_silent_is_over(seen, monkeypatch):
    view, _, _ = seen
    view._on_path(path_of("reach_human", (0.1, 0, 0.3), (0.4, 0, 0.3)), "dmp")
    later = ros_view.time.monotonic() + 1.5
    monkeypatch.setattr(ros_view.time, "monotonic", lambda: later)
    assert not view.path_runs()


def test_what_is_no_path_is_not_drawn(seen):
    view, _, _ = seen
    elsewhere = path_of("x", (0.1, 0, 0.3), (0.4, 0, 0.3))
    elsewhere.header.frame_id = "somewhere"
    without_times = path_of("x", (0.1, 0, 0.3))
    without_times.times = []
    for path in (elsewhere, without_times, path_of("x"), path_of("x", *[(0.0, 0.0, 0.0)] * 1000)):
        assert view.shown("ahead", path) is None
