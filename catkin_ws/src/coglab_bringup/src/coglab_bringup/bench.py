"""./coglab bench: builds the helper programs of the benchmarks, runs the benchmarks and writes their page."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from coglab_bringup import process_tree
from coglab_bringup.arguments import bench_options
from coglab_bringup.usage import Refused

TIME_LIMIT = 4 * 3600.0  # s per program


def build_helpers(top: Path) -> None:
    """Build the C++ programs of the benchmarks against the built workspace."""
    build, log = top / ".coglab" / "benchmarks", top / ".coglab" / "benchmarks.log"
    configure = ["cmake", "-S", str(top / "benchmarks"), "-B", str(build), "-DCMAKE_BUILD_TYPE=Release"]
    configure.append("-DPYTHON_EXECUTABLE=/usr/bin/python3")
    with log.open("w") as output:
        for command in (configure, ["cmake", "--build", str(build), "-j", str(os.cpu_count() or 1)]):
            if subprocess.run(command, stdout=output, stderr=subprocess.STDOUT, check=False).returncode != 0:
                raise Refused(f"the helpers of the benchmarks could not be built; whole log: {log}")


def main(arguments: list[str]) -> int:
    """Exit status 0: every program finished; 1: a program failed; 2: invalid arguments."""
    top = Path(os.environ["COGLAB_TOP"])
    folder = top / "benchmarks"
    python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
    try:
        options = bench_options(top, arguments)
        if options.names:
            build_helpers(top)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    failed = []
    for name in options.names:
        print(f"[coglab] benchmark {name} ...", file=sys.stderr, flush=True)
        command = [python, str(folder / f"{name}.py"), *(["--quick"] if options.quick else [])]
        if process_tree.run(command, TIME_LIMIT) != 0:
            failed.append(name)
    if options.report and not failed:
        failed += ["report"] if process_tree.run([python, str(folder / "report.py")], TIME_LIMIT) != 0 else []
    if failed:
        print(f"[coglab] error: did not run to their end: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
