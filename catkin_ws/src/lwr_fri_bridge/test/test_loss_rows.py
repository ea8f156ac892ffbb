"""The rows of ./coglab bench fri about losses are missed where a run shows nothing, however good its numbers look."""

import importlib.util
from pathlib import Path

import pytest

BENCH = Path(__file__).resolve().parents[1] / "bench" / "bench_fri.py"


@pytest.fixture(scope="module")
def bench():
    """The bench as a module."""
    spec = importlib.util.spec_from_file_location("bench_fri_of_losses", BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("worst, slow, ok", [(1.4, 0.0, True), (1.6, 0.0, False), (1.4, 1.0, False)])
def test_a_stop_that_was_not_from_full_speed_makes_its_row_missed(bench, worst, slow, ok):
    largest, mean = bench.stop_rows(0.005, "single", 1.1, worst, slow)
    assert largest["ok"] is ok and mean["value"] == 1.1
    assert ("not from full speed" in largest["figure"]) is bool(slow)


@pytest.mark.parametrize(
    "line, beyond, failed",
    [([0.005, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, False), ([0.005, 0.1, 0, 0, 0, 0, 1], 0.0, True)],
)
def test_a_run_that_did_not_start_or_left_command_mode_makes_its_row_missed(bench, line, beyond, failed):
    row, speed = bench.approach_rows(0.005, [[0.005, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], line], "from the first cycle on")
    assert row["value"] == beyond and row["ok"] is not failed and speed["ok"] is not failed


def test_a_set_point_beyond_its_bound_makes_its_row_missed(bench):
    row, speed = bench.approach_rows(0.005, [[0.005, 0.1, 0.3, 0.0, 0.0, 1.0, 0.0]], "from the first cycle on")
    assert row["value"] == 0.3 and not row["ok"] and speed["ok"]
