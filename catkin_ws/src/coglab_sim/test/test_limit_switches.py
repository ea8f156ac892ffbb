"""Limits while datagrams are lost, as the stand-in's software limit switches see them; ./coglab bench fri runs more."""

import random
import sys
from collections import deque
from itertools import islice
from pathlib import Path

import lwr_fri_bridge as bridge_module
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_fri
from limit_approaches import IN_A_ROW, OF_HUNDRED, Approach, Losses, Lost, approach
from wire import LIMITS


@pytest.mark.parametrize("seed, period", [(1, 0.02), (8, 0.005), (3, 0.002)])
@pytest.mark.parametrize("bursts", [False, True])
def test_no_limit_switch_is_met_at_full_speed_while_datagrams_are_lost(seed, period, bursts):
    assert approach(period, Losses(0.10, bursts), seed) == Approach(limit_switches=0, arrived=True)


def test_a_switch_within_the_range_of_the_bridge_is_counted_and_ends_command_mode():
    switches = [limit - 0.05 for limit in bridge_module.JointLimits(LIMITS).upper_position]
    found = approach(0.005, Losses(0.0), 1, krc__position_limit=switches)
    assert found == Approach(limit_switches=1, arrived=False)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.05, 0.10])
@pytest.mark.parametrize("bursts", [False, True])
def test_as_much_is_lost_as_the_row_says_and_no_more_than_the_stand_in_rides_through(share, bursts):
    lost = [one is not Lost.NOTHING for one in islice(Losses(share, bursts).pattern(random.Random(1)), 40000)]
    assert sum(lost) / len(lost) == pytest.approx(share, rel=0.2)
    in_a_row, longest, window = 0, 0, deque(maxlen=100)
    for one in lost:
        in_a_row = in_a_row + 1 if one else 0
        longest = max(longest, in_a_row)
        window.append(one)
        assert sum(window) <= OF_HUNDRED
    assert longest == (0 if share == 0.0 else IN_A_ROW if bursts else 1)


@pytest.mark.parametrize(
    "found, ok",
    [
        ([Approach(0, True)] * 3, True),
        ([Approach(0, True), Approach(1, True)], False),
        ([Approach(0, True), Approach(0, False)], False),
    ],
)
def test_the_row_is_missed_by_one_switch_or_by_an_approach_that_shows_nothing(found, ok):
    row = bench_fri.row(0.001, found)
    assert row["ok"] is ok and row["value"] == sum(one.limit_switches for one in found)
