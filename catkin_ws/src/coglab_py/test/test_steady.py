"""Timers, stamps and waits on the steady clock; time slowed down with the simulated cell."""

from __future__ import annotations

import socket
import threading
import time

import pytest
import rospy
from coglab_py import steady
from coglab_py.pace import Slowed


@pytest.fixture(autouse=True)
def ros(monkeypatch):
    """rospy without a master; collects log messages and the reason for the node's end."""
    said = []
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime.switch_to_wallclock()
    for log in ("loginfo", "logwarn", "logerr", "logfatal"):
        monkeypatch.setattr(rospy, log, lambda text, *values: said.append(text % values))
    monkeypatch.setattr(rospy, "logerr_throttle", lambda _, text: said.append(text))
    monkeypatch.setattr(rospy, "signal_shutdown", said.append)
    monkeypatch.setattr(rospy, "spin", lambda: None)
    monkeypatch.setattr(steady, "ending", lambda: False)
    yield said
    rospy.rostime.switch_to_wallclock()


def test_a_frozen_master_does_not_keep_a_wait_for_a_service(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as frozen:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{frozen.getsockname()[1]}")
        with pytest.raises(rospy.ROSException):
            steady.wait_for_service("/somewhere/service", 0.1)


def test_a_frozen_node_does_not_keep_a_call_of_its_service(monkeypatch):
    monkeypatch.setattr(steady, "service_answers", lambda name: True)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    thawed = threading.Event()
    monkeypatch.setattr(rospy, "ServiceProxy", lambda name, kind: lambda *words: thawed.wait(60.0) and words)
    with pytest.raises(rospy.ROSException, match="/frozen"):
        steady.call_service("/frozen", None, 1, wait=0.1, limit=0.1)
    thawed.set()
    assert steady.call_service("/frozen", None, 1, 2, wait=0.1) == (1, 2)


def test_the_error_of_a_service_reaches_its_caller(monkeypatch):
    def broken(*_):
        raise rospy.ServiceException("broke off")

    monkeypatch.setattr(steady, "service_answers", lambda name: True)
    monkeypatch.setattr(rospy, "ServiceProxy", lambda name, kind: broken)
    with pytest.raises(rospy.ServiceException, match="broke off"):
        steady.call_service("/broken", None, wait=0.1)


def set_ros(seconds):
    rospy.rostime._set_rostime(rospy.Time.from_sec(seconds))


def wait(condition):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, "it waits too long"
        time.sleep(0.005)


def test_a_timer_continues_while_the_clock_stands_or_goes_back():
    calls = []
    set_ros(100.0)
    timer = steady.SteadyTimer(0.01, lambda: calls.append(rospy.get_time()), "timer")
    wait(lambda: len(calls) > 2)
    set_ros(70.0)
    wait(lambda: calls.count(70.0) > 2)
    timer.shutdown()
    count = len(calls)
    time.sleep(0.05)
    assert len(calls) == count and calls.count(100.0) > 2


def test_single_failures_do_not_end_a_timer_but_lasting_ones_end_the_node(ros, monkeypatch):
    calls = []

    def fail_at_first():
        calls.append(1)
        if len(calls) < 3:
            raise ValueError("early")

    timer = steady.SteadyTimer(0.01, fail_at_first, "timer")
    wait(lambda: len(calls) > 5)
    timer.shutdown()
    assert steady.spin() == 0 and len(ros) == 2
    monkeypatch.setattr(steady, "FAILING", 0.1)
    steady.SteadyTimer(0.01, lambda: [][0], "always")
    wait(lambda: steady.exit_status() == 1)
    wait(lambda: "the thread 'always' has ended" in ros)
    assert steady.spin() == 1


def test_stamps_are_converted_across_a_step_of_the_clock(monkeypatch):
    now = [50.0, 1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "time", lambda: now[1])
    stamps = steady.Stamps()
    assert stamps.steady(rospy.Time.from_sec(999.8)) == pytest.approx(49.8)
    for late in (0.03, -0.03):  # like /clock, which is published only now and then
        now[1] += late
        assert stamps.steady(rospy.Time.from_sec(999.8)) == pytest.approx(49.8, abs=0.001)
    now[1] -= 30.0
    assert stamps.steady(rospy.Time.from_sec(969.9)) == pytest.approx(49.9, abs=0.001)
    assert stamps.stamp(49.9).to_sec() == pytest.approx(969.9, abs=0.001)


def test_waiting_for_a_service_ends_on_the_steady_clock(monkeypatch):
    monkeypatch.setattr(time, "time", lambda: 1000.0)  # rospy's own wait would never end
    begun = time.monotonic()
    with pytest.raises(rospy.ROSException):
        steady.wait_for_service("/nobody", 0.3)
    assert time.monotonic() - begun < 60.0


def test_a_silent_clock_is_a_fault_and_a_set_one_is_logged(ros, monkeypatch):
    now = [50.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    set_ros(0.0)
    watch = steady.ClockWatch()
    now[0] += 0.9
    assert not watch.look()
    now[0] += 0.2
    assert "/clock" in watch.look() and "/clock" in watch.look() and len(ros) == 1
    set_ros(100.0)
    assert not watch.look() and len(ros) == 2
    set_ros(70.0)
    assert not watch.look() and "30.0 s" in ros[-1]
    rospy.rostime.switch_to_wallclock()
    wall = [1000.0]
    monkeypatch.setattr(time, "time", lambda: wall[0])
    watch, count = steady.ClockWatch(), len(ros)
    for step in (0.0, 60.0, 0.0):
        now[0], wall[0] = now[0] + 0.2, wall[0] + 0.2 + step
        assert not watch.look()
    assert len(ros) == count + 1 and "60.0 s" in ros[-1]


def test_slowed_time_passes_by_the_factor_and_never_jumps():
    time = Slowed()
    assert time.at(7.0) == 7.0
    time.change(10.0, 0.5)
    assert [time.at(clock) for clock in (9.0, 10.0, 12.0)] == [9.0, 10.0, 11.0]
    time.change(12.0, 0.25)
    assert [time.at(clock) for clock in (11.0, 12.0, 16.0)] == pytest.approx([10.5, 11.0, 12.0])
    time.change(16.0, 1.0)
    assert time.at(17.0) == pytest.approx(13.0)
    for clock in (5.0, 11.0, 13.0, 17.0):  # earlier moments keep their times
        assert time.clock(time.at(clock)) == pytest.approx(clock)
    assert time.at(11.0) == pytest.approx(10.5)
