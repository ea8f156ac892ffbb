"""Movements followed to their end in virtual time, and the allowed imports of the core."""

from __future__ import annotations

import subprocess
import sys

import pytest
from ih2_hand.follow import follow
from ih2_hand.grasps import CLOSING_MOTORS
from ih2_hand.progress import CloseTask, GraspTask, OpenTask, PreshapeTask
from ih2_hand.reasons import Reason


def grasp(bench, mode: str, level: str, is_current: bool = True):
    verdict = follow(bench.driver, PreshapeTask(mode, level, is_current, 10.0))
    assert verdict.ok, verdict.text
    return follow(bench.driver, GraspTask(CLOSING_MOTORS[mode], 10.0))


@pytest.mark.parametrize(
    ("mode", "level"),
    [
        ("cylindrical", "low"),
        ("cylindrical", "high"),
        ("tridigit", "medium"),
        ("bidigit", "low"),
        ("tridigit2", "low"),
        ("bidigit2", "low"),
        ("lateral", "high"),
    ],
)
@pytest.mark.parametrize("is_current", [True, False])
def test_every_grasp_holds_an_object(bench, mode, level, is_current):
    closing = CLOSING_MOTORS[mode]  # the others fold out of the way, past the object
    bench.hand.set_contacts([120 if motor in closing else 255 for motor in range(5)], [20] * 5)
    verdict = grasp(bench, mode, level, is_current)
    assert verdict.ok and verdict.holding, verdict.text
    opened = follow(bench.driver, OpenTask(511))
    assert opened.ok and opened.holding is False


@pytest.mark.parametrize("mode", list(CLOSING_MOTORS))
def test_every_grasp_closes_on_nothing(make_bench, mode):
    bench = make_bench(dialect="v17")
    verdict = grasp(bench, mode, "medium")
    assert verdict.ok and verdict.holding is False, verdict.text


@pytest.mark.parametrize("begun", [0.0, 1000.0])
def test_a_movement_is_judged_thirty_times_a_second_from_its_beginning(bench, begun):
    bench.clock.now += begun
    start = bench.clock.now
    elapsed = []

    class Watched(CloseTask):
        def judge(self, motors, since):
            elapsed.append((since, bench.clock.now - start))
            return super().judge(motors, since)

    seen = []
    verdict = follow(bench.driver, Watched(511), on_poll=lambda verdict, motors: seen.append((verdict, len(motors))))
    assert verdict.ok and seen[-1] == (verdict, 5) and not seen[0][0].done
    assert all(since == pytest.approx(now, abs=0.001) for since, now in elapsed)
    assert elapsed[2][0] == pytest.approx(0.1, abs=0.001)


def test_breaking_off_stops_the_fingers(bench):
    polls = []
    verdict = follow(
        bench.driver, CloseTask(100), on_poll=lambda verdict, motors: polls.append(motors) or len(polls) > 10
    )
    assert "broken off" in verdict.text and len(polls) == 11
    assert verdict.done and verdict.reason is Reason.CANCELLED
    bench.hand.advance()
    assert all(motor.mode == "stop" for motor in bench.hand.motors)


def test_a_resynchronisation_on_the_way_is_survived(bench):
    count = 0

    def lose(verdict, motors):
        nonlocal count
        count += 1
        if count in (5, 12):
            bench.faults.lose = 1
        return False

    assert follow(bench.driver, CloseTask(200), on_poll=lose).ok
    assert bench.driver.counters.fillers == 2


def test_core_needs_pyserial_alone():
    script = (
        "import sys; import ih2_hand.driver, ih2_hand.follow, ih2_hand.trace\n"
        "import ih2_hand.emulator.pty_server\n"
        "print([name for name in sys.modules if name.split('.')[0] in "
        "('rospy', 'roslib', 'actionlib', 'yaml', 'numpy', 'coglab_msgs')])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=600, check=True)
    assert done.stdout.strip() == "[]"
