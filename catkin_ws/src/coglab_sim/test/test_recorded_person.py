"""A person whose hand follows a recording: arrival, release, refused recordings, and the three variants after the
reach."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_sim.person.participant import Participant
from coglab_sim.person.recorded_motion import Playback, PlaybackSettings, Recording, RecordingError, Track
from coglab_sim.person.recorded_person import RecordedHand, RecordedPerson, open_recorded_hand, scene_of
from coglab_sim.person.scene import Scene, WorldView
from person_phase import carried, percept

RATE = 0.02
OBJECT = "object_mug"
IN_HAND = np.array([-0.085, 0.01, -0.045])


def track(stamps, places, turn=(0.0, 0.0, 0.0, 1.0)):
    return Track(np.asarray(stamps), np.asarray(places), np.tile(turn, (len(stamps), 1)))


def reach(stands=1.0, way=0.4, leaves=True, speed=0.4):
    """The hand's x: out at 0.4 m/s, standing, and back."""
    out = np.arange(0.0, way, speed * RATE)
    return np.concatenate([out, np.full(round(stands / RATE), way), out[::-1] if leaves else []])


def recorded(x=None, lets_go=None, object_frame=OBJECT, apart=IN_HAND, **settings):
    """A recorded hand along x with the mug in it, which from ``lets_go`` (s) on stays behind."""
    x = reach() if x is None else x
    stamps = RATE * np.arange(len(x))
    hand = np.column_stack([x, np.zeros(len(x)), np.full(len(x), 0.4)])
    thing = hand + apart
    if lets_go is not None:
        thing[stamps > lets_go] = thing[int(lets_go / RATE)]
    tracks = {"human_hand": track(stamps, hand)}
    if object_frame:
        tracks[object_frame] = track(stamps, thing)
    return RecordedHand(Playback(Recording(tracks), PlaybackSettings(file="r.csv", **settings)), object_frame)


# -- what was recorded --------------------------------------------------------------------------------------------


def test_a_hand_has_arrived_when_it_is_far_out_and_slow():
    hand = recorded()
    assert hand.arrived == pytest.approx(1.0, abs=0.03) and hand.end == pytest.approx(3.0, abs=0.05)
    slow = recorded(np.concatenate([reach(0.0, leaves=False), 0.4 + 0.045 * RATE * np.arange(50)]))
    assert slow.arrived == pytest.approx(1.0, abs=0.03), "slower than 5 cm/s"
    never = recorded(np.concatenate([reach(0.0, leaves=False), 0.4 - 0.06 * RATE * np.arange(1, 50)]))
    assert never.arrived == pytest.approx(1.0, abs=0.03), "else where it is farthest out"


def test_an_object_is_let_go_when_it_leaves_the_hand_or_at_the_end_of_the_rest():
    hand = recorded(lets_go=2.1)
    # It has moved 5 cm in the hand an eighth of a second after the hand has left it.
    assert hand.released == pytest.approx(2.1 + 0.05 / 0.4, abs=0.045)
    held = recorded()
    assert held.released == pytest.approx(1.97, abs=0.03)
    alone = recorded(object_frame=None)
    assert alone.object_in_hand is None and alone.released == held.released
    early = recorded(lets_go=0.3)
    assert early.released == early.arrived, "not before it has arrived"


def test_where_the_object_lies_in_the_hand():
    hand = recorded()
    assert hand.object_in_hand.position == pytest.approx(IN_HAND)
    scene = scene_of(Scene(), hand)
    assert scene.object_in_hand == pytest.approx(IN_HAND) and np.abs(scene.object_turn) == pytest.approx([0, 0, 0, 1])
    assert scene.object_mass == Scene().object_mass
    plain = Scene()
    assert scene_of(plain, recorded(object_frame=None)) is plain


def test_recordings_without_a_handover_are_refused():
    with pytest.raises(RecordingError, match=r"r.csv: 'human_hand'.* 0\.09\d m"):
        recorded(reach(way=0.096, speed=0.1))
    recorded(reach(way=0.11, speed=0.1))
    recorded(apart=np.array([0.299, 0.0, 0.0]))
    with pytest.raises(RecordingError, match="'object_mug' begins 0.31 m"):
        recorded(apart=np.array([0.0, 0.31, 0.0]))
    tracks = {OBJECT: track([0.0, 1.0], np.zeros((2, 3)))}
    with pytest.raises(RecordingError, match="'human_hand'.* object_mug"):
        RecordedHand(Playback(Recording(tracks), PlaybackSettings()), None)


def write(path, frames):
    x = reach()
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("t,x,y,z,frame\n")
        for i, each in enumerate(x):
            stream.writelines(f"{RATE * i},{each},0,0.4,{frame}\n" for frame in frames)
    return str(path)


def test_settings_of_a_recorded_hand(tmp_path):
    both, alone = write(tmp_path / "b.csv", ("human_hand", OBJECT)), write(tmp_path / "a.csv", ("human_hand",))
    hand, way = open_recorded_hand({"file": both}, OBJECT)
    assert way == "wait" and hand.object_in_hand.position == pytest.approx(np.zeros(3))
    hand, way = open_recorded_hand({"file": alone, "person": "leave", "object": "in_hand", "time_scale": 2.0}, OBJECT)
    assert way == "leave" and hand.object_in_hand is None and hand.playback.settings.time_scale == 2.0
    for settings, words in (
        ({"file": alone}, "needs the frame 'object_mug', the recording has human_hand"),
        ({"file": both, "person": "stay"}, "person must be wait, no_wait, leave, got 'stay'"),
        ({"file": both, "object": "gone"}, "object must be recorded or in_hand, got 'gone'"),
        ({"file": both, "speed": 1}, "unknown fields speed"),
    ):
        with pytest.raises(RecordingError, match=words):
            open_recorded_hand(settings, OBJECT)


# -- the person ---------------------------------------------------------------------------------------------------


class Shown:
    """A recorded person in virtual time, who perceives ``seen``. ``sample``: the newest sample of the hand."""

    def __init__(self, way="wait", hand=None, **changes):
        self.hand = hand or recorded()
        self.human = RecordedPerson(replace(Participant(seed=1), **changes), Scene(), self.hand, way)
        self.seen = percept(load=carried(1.0))
        self.human.senses = SimpleNamespace(step=lambda t, view: self.seen)
        self.human.command("give mug")
        self.t = 0.0
        self.sample = self.human.step(self.t, WorldView())

    def step(self, dt=0.01):
        self.t += dt
        self.sample = self.human.step(self.t, WorldView())

    def until(self, phase, limit=20.0):
        while self.t < limit and self.human.phase != phase:
            self.step()
        return self.t


def test_it_begins_at_once_where_the_recording_begins():
    shown = Shown()
    assert shown.sample.frame.position == pytest.approx([0.0, 0.0, 0.4])
    assert shown.human.phase == "reaching" and shown.human.rest == pytest.approx([0.0, 0.0, 0.4])
    shown.step()
    shown.step()
    assert shown.sample.frame.position == pytest.approx([0.4 * shown.t, 0.0, 0.4])
    assert shown.sample.velocity == pytest.approx([0.4, 0.0, 0.0]) and not shown.sample.spin.any()


def test_no_wait_holds_the_object_at_the_recorded_release():
    shown = Shown("no_wait", hand=recorded(lets_go=1.5))
    assert shown.until("holding") == pytest.approx(shown.hand.released, abs=0.03) and shown.hand.released > 1.9


@pytest.mark.parametrize(
    "load, closure, closing, lets_go",
    [(0.69, 0.0, 0.0, True), (0.75, 0.0, 0.0, False), (1.0, 0.051, 0.0, False), (0.9, 0.049, 0.0, False)],
)
def test_leave_releases_a_held_object_and_takes_others_away(load, closure, closing, lets_go):
    shown = Shown("leave", release_share=0.3, release_time=0.2)
    while shown.t < shown.hand.arrived:
        shown.step()
    shown.seen = percept(load=carried(load), closure=closure, closing=closing)
    while shown.t < shown.hand.released - 0.02:
        shown.step()
        assert shown.sample.grip == 1.0, "not before it was recorded"
    assert shown.until("idle") == pytest.approx(shown.hand.end, abs=0.04)
    assert shown.sample.grip == (0.0 if lets_go else 1.0)
    assert shown.sample.frame.position[0] == pytest.approx(0.0, abs=0.02), "it has gone all the same"
