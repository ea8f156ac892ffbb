#!/usr/bin/python3
"""Answer latency of the bridge against a bare echo, at 1 kHz, in command mode.

A control thread is running. Blocks of 500 packets go to echo, bridge, bridge, echo. The ratio of the
medians of neighbouring blocks is judged by its median over all pairs, with the distribution-free 95 %
interval of that median. The ratio of the 99th percentiles is shown beside the same ratio of echo against
echo: on a machine that is not a real-time one it says more about the machine. Prints JSON.
"""

from __future__ import annotations

import json
import math
import os
import pathlib
import shutil
import statistics
import subprocess
import sys

QUADS = int(os.environ.get("COGLAB_BENCH_QUADS", "20"))
LIMIT = 1.10
PEER = "lwr_fri_bridge_latency_peer"


def find_peer() -> str:
    """Path of the helper binary in the sourced workspace."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = pathlib.Path(prefix) / "lib" / "lwr_fri_bridge" / PEER
        if path.is_file():
            return str(path)
    found = shutil.which(PEER)
    if found is None:
        sys.exit(f"{PEER} not found: build the workspace and source its setup.bash")
    return found


def start_peer(binary: str, *arguments: str) -> tuple[subprocess.Popen[str], int]:
    process = subprocess.Popen([binary, *arguments], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, int(process.stdout.readline())


def percentile(values: list[float], part: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def median_interval(values: list[float]) -> tuple[float, float]:
    """95 % interval of the median from order statistics (normal approximation of the binomial)."""
    ordered = sorted(values)
    n = len(ordered)
    half = 1.96 * math.sqrt(n) / 2.0
    low = max(0, math.floor(n / 2.0 - half))
    high = min(n - 1, math.ceil(n / 2.0 + half) - 1)
    return ordered[low], ordered[high]


def measure() -> list[tuple[str, list[float]]]:
    limits = (
        pathlib.Path(__file__).resolve().parents[2] / "lwr_description/config/joint_limits.yaml"
    )
    binary = find_peer()
    peers = []
    try:
        echo, echo_port = start_peer(binary, "echo")
        peers.append(echo)
        bridge, bridge_port = start_peer(binary, "bridge", str(limits))
        peers.append(bridge)
        run = subprocess.run(
            [binary, "measure", str(echo_port), str(bridge_port), str(QUADS)],
            stdout=subprocess.PIPE,
            text=True,
            check=True,
            timeout=60 + 10 * QUADS,
        )
    finally:
        for peer in peers:
            peer.terminate()
        for peer in peers:
            try:
                peer.wait(timeout=5)
            except subprocess.TimeoutExpired:
                peer.kill()
    blocks = []
    for line in run.stdout.splitlines():
        kind, *values = line.split()
        blocks.append((kind, [float(value) for value in values]))
    return blocks


def main() -> None:
    blocks = measure()
    answered = [(kind, [v for v in values if v >= 0.0]) for kind, values in blocks]
    medians = [statistics.median(values) for _, values in answered]
    p99s = [percentile(values, 0.99) for _, values in answered]
    ratios, p99_ratios, echo_p99_ratios = [], [], []
    for first in range(0, len(blocks), 4):  # echo, bridge, bridge, echo
        ratios += [medians[first + 1] / medians[first], medians[first + 2] / medians[first + 3]]
        p99_ratios += [p99s[first + 1] / p99s[first], p99s[first + 2] / p99s[first + 3]]
        echo_p99_ratios.append(p99s[first + 3] / p99s[first])
    low, high = median_interval(ratios)
    ratio = statistics.median(ratios)
    medians_of = {
        kind: statistics.median(m for (k, _), m in zip(answered, medians, strict=True) if k == kind)
        for kind in ("echo", "bridge")
    }
    missed = {
        kind: sum(v < 0.0 for k, values in blocks if k == kind for v in values)
        for kind in ("echo", "bridge")
    }

    def row(
        figure: str,
        value: float,
        unit: str,
        goal: str = "",
        peer: str | None = None,
        peer_value: float | None = None,
        ok: bool | None = None,
    ) -> dict[str, object]:
        return {
            "bench": "fri",
            "figure": figure,
            "value": round(value, 4),
            "unit": unit,
            "goal": goal,
            "peer": peer,
            "peer_value": None if peer_value is None else round(peer_value, 4),
            "ok": ok,
        }

    print(
        json.dumps(
            [
                row(
                    f"answer latency, median of {len(ratios)} block ratios",
                    ratio,
                    "bridge/echo",
                    f"<= {LIMIT:.2f}, 95 % interval not above",
                    "bare echo",
                    1.0,
                    low <= LIMIT,
                ),
                row("answer latency ratio, 95 % interval, low end", low, "bridge/echo"),
                row("answer latency ratio, 95 % interval, high end", high, "bridge/echo"),
                row(
                    "answer latency, median",
                    medians_of["bridge"],
                    "us",
                    "",
                    "bare echo",
                    medians_of["echo"],
                ),
                row(
                    "answer latency, ratio of p99",
                    statistics.median(p99_ratios),
                    "bridge/echo",
                    "",
                    "echo/echo",
                    statistics.median(echo_p99_ratios),
                ),
                row(
                    "answers missing within 20 ms",
                    missed["bridge"],
                    "packets",
                    "",
                    "bare echo",
                    missed["echo"],
                ),
            ],
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
