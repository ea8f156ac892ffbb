"""./coglab demo: launches everything, takes an object from the person, gives it back, writes what happened, stops."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from coglab_bringup import process_tree
from coglab_bringup.arguments import demo_parser
from coglab_bringup.commit import commit_of
from coglab_bringup.run_directory import free_port, record_run, run_environment
from coglab_bringup.usage import Refused

OBJECT = "mug"  # what the simulated person offers (coglab_sim/config/cell.yaml)
KINDS = ("exchange_human_to_robot", "exchange_robot_to_human")  # take it from the person, then give it back
MASTER_LIMIT = 30.0  # s until the ROS master answers


class System:
    """The launched system of one run; `stop()` ends every process of it."""

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
        """Whether roslaunch still runs."""
        return self._process.poll() is None

    def stop(self) -> None:
        """SIGINT to roslaunch, as Ctrl-C does; returns when nothing is left of it."""
        self._process.send_signal(signal.SIGINT)
        self._process.wait()
        self._log.close()


def say_console(home: Path, limit: float = 30.0) -> None:
    """Prints where the experimenter's page is, as soon as its node has written it; gives up after `limit` s."""
    deadline, link = time.monotonic() + limit, home / "console.url"
    while not link.is_file() and time.monotonic() < deadline:
        time.sleep(0.2)
    words = link.read_text().strip() if link.is_file() else f"no address within {limit:.0f} s; see roslaunch.log"
    print(f"[coglab] console: {words}", flush=True)


def _interrupt(*_signal: object) -> None:
    raise KeyboardInterrupt


def wait_for_master(system: System, limit: float) -> None:
    """Waits until the ROS master of this run answers. RuntimeError after `limit` seconds or if roslaunch ended."""
    import rosgraph

    deadline = time.monotonic() + limit
    while not rosgraph.is_master_online():
        if not system.alive():
            raise RuntimeError("roslaunch ended before its master answered")
        if time.monotonic() > deadline:
            raise RuntimeError(f"the ROS master did not answer within {limit:.0f} s")
        time.sleep(0.1)


def unfinished(kind: str, error: BaseException) -> dict:
    """The row of a handover that did not come to its end."""
    from coglab_msgs.msg import ReasonCode

    interrupted = isinstance(error, KeyboardInterrupt)
    code = ReasonCode.CANCELLED if interrupted else getattr(error, "code", ReasonCode.NODE_SILENT)
    return {"kind": kind, "outcome": str(error) or "interrupted", "reason_code": int(code)}


PEOPLE = {
    "patient": (
        ("profile:=patient", "perfect_perception:=true"),
        "a patient person, who waits for the robot and is seen without noise or delay; people as they are: "
        "./coglab demo --person drawn",
    ),
    "accustomed": (
        ("profile:=accustomed", "perfect_perception:=true"),
        "an accustomed person, who waits for the robot, helps it by habit and is seen without noise or delay",
    ),
    "drawn": ((), "a person drawn by the seed, as people are, seen by the tracker as it is"),
}
"""Arguments of the launch file, and what they mean."""


def main(arguments: list[str]) -> int:
    """Exit status 0 if every handover succeeded."""
    top = Path(os.environ["COGLAB_TOP"])
    try:
        options = demo_parser(top).parse_args(arguments)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    signal.signal(signal.SIGTERM, _interrupt)  # what happened until then is still written down
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
    launch += [f"console:={'false' if options.no_console else 'true'}", *person]
    (out / "ros_home" / "console.url").unlink(missing_ok=True)  # of an earlier demo
    system = System(environment, port, launch, out / "roslaunch.log")
    result: dict = {"commit": commit_of(top), "seed": options.seed, "person": options.person, "handovers": []}
    try:
        wait_for_master(system, MASTER_LIMIT)
        if not options.no_console:
            threading.Thread(target=say_console, args=(out / "ros_home",), daemon=True).start()
        import rospy

        from coglab_bringup.handover import run_handover
        from coglab_bringup.trial_plot import draw_trial
        from coglab_bringup.trial_recorder import TrialRecorder

        rospy.init_node("coglab_demo", anonymous=True, disable_signals=True)
        recorder = TrialRecorder()
        spans = []
        for kind in KINDS:
            row, start, end = run_handover(kind, OBJECT, recorder, system.alive)
            result["handovers"].append(row)
            spans.append((start, end))
            if row["outcome"] != "success":
                break
        title = ", then ".join(f"{row['kind'].replace('_', ' ')}: {row['outcome']}" for row in result["handovers"])
        draw_trial(
            recorder.stop(), f"{OBJECT}, seed {options.seed}; {title}", spans[0][0], spans[-1][1], out / "trial.png"
        )
    except (RuntimeError, KeyboardInterrupt) as error:
        result["handovers"].append(unfinished(KINDS[min(len(result["handovers"]), len(KINDS) - 1)], error))
    finally:
        (out / "result.json").write_text(json.dumps(result, indent=1) + "\n")
        system.stop()
    return summarise(out, result["handovers"])


def summarise(out: Path, handovers: list[dict]) -> int:
    """Prints how each handover ended; returns exit status 0 if all succeeded."""
    good = sum(row["outcome"] == "success" for row in handovers)
    for row in handovers:
        print(f"{row['kind']}: {row['outcome']}" + (f" in {row['duration_s']:.1f} s" if "duration_s" in row else ""))
    print(
        f"{good} of {len(KINDS)} handovers succeeded; {out}/result.json and trial.png, log: {out}/roslaunch.log",
        flush=True,
    )
    return 0 if good == len(KINDS) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
