#!/usr/bin/python3
"""Train reaching patterns from recorded motion.

Usage: train_patterns.py -o patterns.json NAME=FILE.csv[,FILE.csv...] ...
Each CSV holds one reach: a header line, then t,x,y,z[,...] in s and m (robot base frame), with at least 0.4 s of rest
before the reach. A recording shorter than 0.05 m, or faster than 5 m/s between two samples, is refused unless --allow
short or --allow jump is given. Exit status: 0 done, 1 the recordings cannot be used, 2 wrong usage.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from coglab_perception.recogniser import RecogniserSettings, save_patterns, train_patterns

SHORTEST = 0.05  # m, smallest distance of a reach's farthest point from its start
FASTEST = 5.0  # m/s, largest speed between two samples


def read(path: str, allow: Sequence[str] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (s) and positions (m) of one recording."""
    try:
        data = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2, 3), ndmin=2)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: expected a header and lines t,x,y,z: {error}") from None
    if len(data) < 10 or not np.all(np.isfinite(data)) or np.any(np.diff(data[:, 0]) <= 0):
        raise ValueError(f"{path}: expected at least 10 finite lines with increasing time")
    times, positions = data[:, 0], data[:, 1:4]
    far = np.linalg.norm(positions - positions[0], axis=1).max()
    if far < SHORTEST and "short" not in allow:
        raise ValueError(
            f"{path}: the reach is {far:.3f} m long, expected at least {SHORTEST} m; cut it again, or use --allow short"
        )
    fastest = (np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(times)).max()
    if fastest > FASTEST and "jump" not in allow:
        raise ValueError(
            f"{path}: {fastest:.1f} m/s between two samples, expected at most {FASTEST}; repair it, or use --allow jump"
        )
    return times, positions


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("patterns", nargs="+", metavar="NAME=FILE.csv,...")
    parser.add_argument("--allow", action="append", default=[], choices=["short", "jump"])
    arguments = parser.parse_args()
    try:
        recordings = {}
        for item in arguments.patterns:
            name, _, files = item.partition("=")
            if not name or not files:
                parser.error(f"expected NAME=FILE.csv,..., got '{item}'")
            recordings[name] = [read(f, arguments.allow) for f in files.split(",")]
        patterns = train_patterns(recordings)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    save_patterns(arguments.output, patterns, RecogniserSettings(), "train_patterns.py")
    for p in patterns:
        print(f"{p.name}: {len(recordings[p.name])} recordings, floor {p.floor:.1f} per frame")
    print(f"wrote {arguments.output}; next: set ~patterns of motion_recogniser_node.py to it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
