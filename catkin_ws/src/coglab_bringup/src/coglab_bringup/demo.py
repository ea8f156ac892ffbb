"""./coglab demo: launches the system, takes an object from the person, gives it back, writes the results, stops."""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from coglab_py.node_start import log_without_raising
from coglab_py.running_systems import record_run

from coglab_bringup import process_tree
from coglab_bringup.arguments import demo_parser
from coglab_bringup.run_directory import free_port, print_load, run_environment
from coglab_bringup.usage import Refused

OBJECT = "mug"  # object that the simulated person offers (coglab_sim/config/cell.yaml)
KINDS = ("exchange_human_to_robot", "exchange_robot_to_human")  # in this order
MASTER_LIMIT = 30.0  # s until the ROS master answers, counted while roslaunch uses no processor time
SLOW_START = 10.0  # s until the cell runs, after which a high load of this computer is printed
CONSOLE_LIMIT = 30.0  # s until a message reports that the console starts late


class System:
    """The launched system of one run. `stop()` ends all of its processes."""

    def __init__(self, environment: dict[str, str], port: int, arguments: list[str], log: Path) -> None:
        self._log = log.open("w")
        command = ["roslaunch", "-p", str(port), "coglab_bringup", "coglab.launch", *arguments]
        self._process = subprocess.Popen(
            process_tree.above(command),
            env=environment,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )

    def alive(self) -> bool:
        """True while roslaunch runs."""
        return self._process.poll() is None

    def processor_time(self) -> float:
        """Processor time (s) that its processes have used."""
        return process_tree.processor_time(self._process.pid)

    def stop(self) -> None:
        """Send SIGINT to roslaunch, as Ctrl-C does. Returns when all processes have ended."""
        self._process.send_signal(signal.SIGINT)
        self._process.wait()
        self._log.close()


def say_console(home: Path, alive: Callable[[], bool], limit: float = CONSOLE_LIMIT) -> None:
    """Print the address of the experimenter's page when its node has written it, or after `limit` s that it is late."""
    late, link = time.monotonic() + limit, home / "console.url"
    while not link.is_file() and alive():
        if time.monotonic() > late:
            print(f"[coglab] console: still starting after {limit:.0f} s; see roslaunch.log", flush=True)
            late = float("inf")
        time.sleep(0.2)
    if link.is_file():
        print(f"[coglab] console: {link.read_text().strip()}", flush=True)


class PaceWatch:
    """Prints why the system is slow: the load of this computer if the cell does not run yet, then each lower real-time
    factor of the cell. Stores the lowest factor."""

    def __init__(self) -> None:
        self.lowest = 1.0
        self.slow_start = threading.Timer(SLOW_START, print_load)
        self.slow_start.daemon = True
        self.slow_start.start()

    def follow(self) -> None:
        """Subscribe to the cell's real-time factor."""
        from coglab_py.pace import TOPIC
        from rospy import Subscriber
        from std_msgs.msg import Float64

        self._subscriber = Subscriber(TOPIC, Float64, lambda message: self.take(message.data))

    def take(self, factor: float) -> None:
        """Process a new real-time factor of the cell."""
        self.slow_start.cancel()  # the cell runs
        if factor < self.lowest:
            self.lowest = factor
            print(
                f"[coglab] this computer is too busy for real time: the simulated cell runs at {factor:g} of it, "
                "and everything takes that much longer; measurements are in roslaunch.log",
                flush=True,
            )


MAKE_ROOM = "make room, or name another folder: --out DIR"


def keep(problems: list[str], folder: Path, name: str, write: Callable[[Path], object]) -> None:
    """Write a file completely or not at all: call `write` with a temporary path, then move the result into `folder`.
    A full disk leaves no partial file. If it fails, `problems` receives a sentence."""
    try:
        with tempfile.TemporaryDirectory(prefix=".part-", dir=folder) as part:
            write(Path(part) / name)
            for file in Path(part).iterdir():
                file.replace(folder / file.name)
    except OSError as error:
        problems.append(f"{folder / name} could not be written ({error.strerror or error}); {MAKE_ROOM}")


def commit_of(top: Path) -> str:
    """The commit of this checkout; "unknown" outside of a checkout or without git."""
    try:
        command = ["git", "-C", str(top), "rev-parse", "HEAD"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _interrupt(*_signal: object) -> None:
    raise KeyboardInterrupt


def wait_for_master(system: System, limit: float) -> None:
    """Wait until the run's ROS master answers. RuntimeError if roslaunch ended, or was idle for `limit` s."""
    import rosgraph

    moved, before = time.monotonic(), -1.0
    while not rosgraph.is_master_online():
        if not system.alive():
            raise RuntimeError("roslaunch ended before its master answered")
        if (used := system.processor_time()) > before:
            moved, before = time.monotonic(), used
        if time.monotonic() > moved + limit:
            raise RuntimeError(f"the ROS master did not answer, and roslaunch did nothing for {limit:.0f} s")
        time.sleep(0.1)


def unfinished(kind: str, error: BaseException) -> dict:
    """Result row of a handover that did not finish."""
    from coglab_msgs.msg import ReasonCode

    interrupted = isinstance(error, KeyboardInterrupt)
    code = ReasonCode.CANCELLED if interrupted else getattr(error, "code", ReasonCode.NODE_SILENT)
    return {"kind": kind, "outcome": str(error) or "interrupted", "reason_code": int(code)}


PEOPLE = {
    "patient": (
        ("profile:=patient", "perfect_perception:=true"),
        "a patient person, who waits for the robot and is seen without noise or delay; people who differ: "
        "./coglab demo --person drawn",
    ),
    "accustomed": (
        ("profile:=accustomed", "perfect_perception:=true"),
        "an accustomed person, who waits for the robot, helps it by habit and is seen without noise or delay",
    ),
    "drawn": ((), "a person drawn by the seed, seen with noise and delay"),
}
"""Launch arguments of each kind of person, and their description."""


def main(arguments: list[str]) -> int:
    """Exit status 0 if every handover succeeded."""
    top = Path(os.environ["COGLAB_TOP"])
    try:
        options = demo_parser(top).parse_args(arguments)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    try:
        return run(top, options)
    except OSError as error:
        print(f"[coglab] error: the demo cannot write its files: {error}; make room, or use --out DIR", file=sys.stderr)
        return 1


def run(top: Path, options: argparse.Namespace) -> int:
    """Launch the system, do the handovers, write the results, stop. Returns the exit status."""
    signal.signal(signal.SIGTERM, _interrupt)  # write the results up to this moment
    out: Path = options.out.absolute()
    out.mkdir(parents=True, exist_ok=True)
    person, words = PEOPLE[options.person]
    print(f"[coglab] this demo shows {words}", flush=True)
    port = free_port()
    environment = run_environment(port, out / "ros_home")
    os.environ.update(environment)
    record_run(top, port, "demo")
    screen = bool(os.environ.get("DISPLAY")) and not options.headless and Path("/usr/bin/rviz").exists()
    launch = [f"seed:={options.seed}", f"rviz:={'true' if screen else 'false'}", f"log_file:={out / 'fri_ticks.csv'}"]
    trials = out / "trials"
    earlier = set(trials.glob("*/trial.yaml"))
    launch += [f"console:={'false' if options.no_console else 'true'}", *person, f"record:={trials}"]
    (out / "ros_home" / "console.url").unlink(missing_ok=True)  # of an earlier demo
    system = System(environment, port, launch, out / "roslaunch.log")
    pace, problems = PaceWatch(), list[str]()
    result: dict = {"commit": commit_of(top), "seed": options.seed, "person": options.person, "handovers": []}
    try:
        wait_for_master(system, MASTER_LIMIT)
        if not options.no_console:
            threading.Thread(target=say_console, args=(out / "ros_home", system.alive), daemon=True).start()
        import rospy
        from coglab.plot import draw_trial

        from coglab_bringup.handover import run_handover
        from coglab_bringup.trial_recorder import TrialRecorder

        rospy.init_node("coglab_demo", anonymous=True, disable_signals=True)
        log_without_raising()
        recorder = TrialRecorder()
        pace.follow()
        spans: list[tuple[float, float]] = []
        for kind in KINDS:
            row, start, end = run_handover(kind, OBJECT, recorder, system.alive)
            result["handovers"].append(row)
            spans.append((start, end))
            if row["outcome"] != "success":
                break
        title = ", then ".join(f"{row['kind'].replace('_', ' ')}: {row['outcome']}" for row in result["handovers"])
        title = f"{OBJECT}, seed {options.seed}; {title}"
        trial, begin, end = recorder.stop(), spans[0][0], spans[-1][1]
        keep(problems, out, "trial.png", lambda path: draw_trial(trial, title, begin, end, path))
    except (RuntimeError, KeyboardInterrupt) as error:
        result["handovers"].append(unfinished(KINDS[min(len(result["handovers"]), len(KINDS) - 1)], error))
    finally:
        result["real_time_factor"] = pace.lowest
        text = json.dumps(result, indent=1) + "\n"
        keep(problems, out, "result.json", lambda path: path.write_text(text))
        system.stop()
    status = summarise(out, result["handovers"], "" if problems else f"{out}/result.json and trial.png, ")
    page = report_on(sorted(set(trials.glob("*/trial.yaml")) - earlier), problems)
    if page:
        print(f"[coglab] report of the last handover: {page}", flush=True)
    for problem in problems:
        print(f"[coglab] error: {problem}", file=sys.stderr)
    return 1 if problems else status


def report_on(records: list[Path], problems: list[str]) -> str:
    """Write a page for each recorded handover. Returns the path of the last one; empty if nothing was recorded."""
    from coglab_tools.command import CommandError
    from coglab_tools.report.page import write_report
    from coglab_tools.trial.read import read_trial

    page = ""
    for folder in [record.parent for record in records]:
        try:
            trial = read_trial(folder)
        except CommandError as error:
            problems.append(f"no report of a handover: {error}; roslaunch.log has what the recorder said")
            continue
        try:
            page = str(write_report(trial, folder / "report.html"))
        except CommandError as error:
            problems.append(f"{error}; {MAKE_ROOM}")
    return page


def summarise(out: Path, handovers: list[dict], files: str) -> int:
    """Prints how each handover ended, and the files that were written; returns exit status 0 if all succeeded."""
    good = sum(row["outcome"] == "success" for row in handovers)
    for row in handovers:
        print(f"{row['kind']}: {row['outcome']}" + (f" in {row['duration_s']:.1f} s" if "duration_s" in row else ""))
    print(f"{good} of {len(KINDS)} handovers succeeded; {files}log: {out}/roslaunch.log", flush=True)
    return 0 if good == len(KINDS) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
