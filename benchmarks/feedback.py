#!/usr/bin/python3
"""Feedback controllers: time of one of 100 per cycle, as on a robot (bounded, checked, timed and attributed).
Processor time, median of repetitions by google-benchmark, interleaved with a bare loop over the same controllers."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator

from common import Row, helper, main


def guard(quick: bool) -> Iterator[Row]:
    """One controller with its guard."""
    command = [helper("feedback_cycle"), "--benchmark_format=json", "--benchmark_enable_random_interleaving=true"]
    command.append(f"--benchmark_repetitions={3 if quick else 15}")
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=600).stdout)
    errors = [one["error_message"] for one in found["benchmarks"] if one.get("error_occurred")]
    if errors:
        raise RuntimeError(errors[0])
    ns = {
        one["run_name"]: 1e9 / one["items_per_second"]
        for one in found["benchmarks"]
        if one.get("aggregate_name") == "median"
    }
    yield Row("a guarded feedback controller, per cycle", ns["guarded"], "ns", "<= 100")
    yield Row("the same controller in a bare loop, per cycle", ns["bareLoop"], "ns")


if __name__ == "__main__":
    main("feedback", guard)
