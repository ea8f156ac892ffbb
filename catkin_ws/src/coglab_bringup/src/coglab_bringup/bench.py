"""./coglab bench: runs the benches and prints every figure beside its goal and its peer.

A bench is an executable `bench/bench_<name>.py` in a package. It prints a JSON list of rows {bench, figure, value,
unit, goal, peer, peer_value, ok} on standard output and ends with status 0, also where a figure misses its goal.
Another status is a failure, whatever rows were printed. Packages may share a name: each gives its rows.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

from coglab_bringup import process_tree
from coglab_bringup.arguments import bench_options, find_benches
from coglab_bringup.usage import Refused

COLUMNS = ("bench", "figure", "value", "unit", "goal", "peer", "peer_value", "ok")
TIME_LIMIT = 1800.0  # s, per bench
LONG_TIME_LIMIT = 7200.0  # s, with --long


def failed_row(name: str, reason: str) -> dict:
    """The row of a bench that gave no figures."""
    return dict(zip(COLUMNS, (name, f"did not run: {reason}", None, "", "runs", None, None, False), strict=False))


def run_bench(name: str, path: Path, python: str, limit: float = TIME_LIMIT) -> list[dict]:
    """The rows of one bench, and one more that says how it failed; nothing that it started outlives it."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        status = process_tree.run([python, str(path)], limit, stdout=output, stderr=errors)
        output.seek(0)
        errors.seek(0)
        text, last = output.read(), (errors.read().strip().splitlines() or ["no message"])[-1]
    if status is None:
        return [failed_row(name, f"no end within {limit:.0f} s")]
    failed = [failed_row(name, f"exit status {status}: {last}")] if status != 0 else []
    try:
        rows = [{column: row[column] for column in COLUMNS} for row in json.loads(text)] + failed
        return rows or [failed_row(name, "no row on standard output")]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        return failed or [failed_row(name, f"no list of rows on standard output ({error})")]


def as_text(value: object) -> str:
    """A cell of the table."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "ok" if value else "MISSED"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def print_table(rows: list[dict]) -> None:
    """Prints rows in aligned columns."""
    cells = [[as_text(row[column]) for column in COLUMNS] for row in rows]
    widths = [max(len(column), *(len(line[i]) for line in cells)) for i, column in enumerate(COLUMNS)]
    for line in [list(COLUMNS), *cells]:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=False)).rstrip(), flush=True)


def main(arguments: list[str]) -> int:
    """Exit status 0 if every row is ok, 1 if one is not, 2 for an unknown name."""
    top = Path(os.environ["COGLAB_TOP"])
    sources = top / "catkin_ws" / "src"
    try:
        options = bench_options(top, arguments)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    if options.long:
        os.environ["COGLAB_LONG"] = "1"
    limit = LONG_TIME_LIMIT if options.long else TIME_LIMIT
    benches = find_benches(sources)
    python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
    rows: list[dict] = []
    for name in options.names or benches:
        print(f"[coglab] bench {name} ...", file=sys.stderr, flush=True)
        rows += [row for path in benches[name] for row in run_bench(name, path, python, limit)]
    print_table(rows)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if all(row["ok"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
