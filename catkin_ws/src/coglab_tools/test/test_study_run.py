"""Simulated studies: conditions act, and after any crash the rows are those of the undisturbed run."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import coglab
import pytest
from coglab_py.packages import package_path
from coglab_tools.__main__ import run
from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.study import settings, simulate
from coglab_tools.study.cluster import local_cluster
from coglab_tools.study.live import machines_file, session, write_machines
from coglab_tools.study.plan import load
from coglab_tools.study.report import write_report
from coglab_tools.study.rows import ROWS, open_rows
from coglab_tools.study.run import run_simulated
from coglab_tools.trial.record import TrialRecord, find_trials

YAML = """\
version: 1
name: kill
participants: 2
conditions:
  calm: {timing: calm}
  natural: {timing: natural, speed: 0.8}
trial: [receive]
record: false
simulated: {person: accustomed, perfect_perception: true}
"""
LIMIT = 240.0  # s, for a run of four trials on a loaded computer


def make(folder: Path, text: str = YAML) -> Path:
    folder.mkdir()
    (folder / "study.yaml").write_text(text)
    return folder


def start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def kill(process: subprocess.Popen[str]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait(120)


def wait_for_rows(folder: Path, count: int, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + LIMIT
    while not (folder / ROWS).exists() or (folder / ROWS).read_bytes().count(b"\n") < count + 1:
        if process.poll() is not None or time.monotonic() > end:
            kill(process)
            pytest.fail(f"no {count} rows: {process.communicate()[0]}")
        time.sleep(0.02)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = make(tmp_path_factory.mktemp("undisturbed") / "kill")
    assert run_simulated(load(folder), workers=1)["trials"] == 4
    return folder


def test_conditions_act_and_the_report_compares_them(undisturbed):
    with open_rows(load(undisturbed)) as rows:
        table = rows.table()
    slow = [row["approach_s"] for row in table if row["condition"] == "calm"]
    quick = [row["approach_s"] for row in table if row["condition"] == "natural"]
    assert min(slow) > 1.2 * max(quick)
    data = write_report(load(undisturbed), pdf=True)
    page = (undisturbed / "report.html").read_text()
    assert "4 of 4" in data["verdict"] and "<script" not in page and 'src="http' not in page
    one = next(c for c in data["comparisons"] if c["measure"] == "receive: approach")
    assert one["pairs"] == 2 and one["difference"] < 0.0
    assert (undisturbed / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_crashed_study_continues_with_the_same_rows(undisturbed, tmp_path):
    folder = make(tmp_path / "kill")
    lines = (undisturbed / ROWS).read_bytes().splitlines(keepends=True)
    (folder / ROWS).write_bytes(b"".join(lines[:4]) + lines[4][:40])  # like after a crash during writing
    with open_rows(load(folder), write=True), pytest.raises(UsageError, match="another process"):
        run_simulated(load(folder), workers=1)
    assert run_simulated(load(folder), workers=1)["trials_now"] == 1
    assert (folder / "trials.csv").read_bytes() == (undisturbed / "trials.csv").read_bytes()


def test_a_local_cluster_listens_only_on_loopback(tmp_path):
    distributed = pytest.importorskip("distributed")
    with local_cluster(distributed, 1, str(tmp_path)):
        found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(os.getpid())], capture_output=True, text=True)
        sockets = set()
        for pid in (os.getpid(), *map(int, found.stdout.split())):
            for each in Path(f"/proc/{pid}/fd").glob("*"):
                with suppress(OSError):
                    sockets.add(os.readlink(each))
        listening = [
            (line.split()[1], f"socket:[{line.split()[9]}]")
            for table in ("tcp", "tcp6")
            for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]
            if line.split()[3] == "0A"
        ]
        places = {address.partition(":")[0] for address, socket in listening if socket in sockets}
    assert places == {"0100007F"}, "127.0.0.1, in hexadecimal digits"


def test_a_lost_worker_and_a_lost_scheduler_change_nothing(undisturbed, tmp_path):
    pytest.importorskip("distributed")
    folder = make(tmp_path / "kill")
    file = tmp_path / "scheduler.json"
    scheduler = start(
        "distributed.cli.dask_scheduler",
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        "--no-dashboard",
        "--scheduler-file",
        str(file),
    )
    worker = (
        "distributed.cli.dask_worker",
        "--nthreads",
        "1",
        "--no-dashboard",
        "--no-nanny",
        "--scheduler-file",
        str(file),
    )
    places = ("--host", "127.0.0.1", "--local-directory", str(tmp_path))
    workers = [start(*worker, *places) for _ in range(2)]
    try:
        end = time.monotonic() + LIMIT
        while not (file.exists() and "address" in file.read_text()):
            assert time.monotonic() < end, "the scheduler does not start"
            time.sleep(0.05)
        address = file.read_text().split('"address": "')[1].split('"')[0]
        study = start("coglab_tools", "study", "run", str(folder), "--scheduler", address)
        wait_for_rows(folder, 1, study)
        kill(workers.pop())
        wait_for_rows(folder, 2, study)
        kill(scheduler)
        said, _ = study.communicate(timeout=LIMIT)
        assert study.returncode == 3 and "study resume" in said and "Traceback" not in said, said
    finally:
        for process in (*workers, scheduler):
            kill(process)
    run_simulated(load(folder), workers=1)
    assert (folder / "trials.csv").read_bytes() == (undisturbed / "trials.csv").read_bytes()


def test_a_worker_of_another_version_is_refused(undisturbed):
    study = load(undisturbed)
    job = simulate.job_of(study, study.trials()[0])
    with pytest.raises(simulate.OtherVersion, match="code"):
        simulate.run(simulate.Job(**{**vars(job), "identity": {**job.identity, "code": "other"}}))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("speed: 0.8", "speed: 0.7", r"study.yaml:4: 'conditions' was changed"),
        ("name: kill", "name: other", r"study.yaml:2: .* one study"),
    ],
)
def test_an_edited_study_is_refused(undisturbed, tmp_path, old, new, words):
    folder = make(tmp_path / "kill", YAML.replace(old, new))
    (folder / ROWS).write_bytes((undisturbed / ROWS).read_bytes())
    with pytest.raises(CheckFailed, match=words):
        run_simulated(load(folder))
    (folder / "study.yaml").write_text(YAML + "# a comment may change\n")
    assert run_simulated(load(folder))["trials_now"] == 0


@pytest.mark.parametrize(
    ("number", "line", "words"),
    [
        (1, b"{}", "rows.jsonl:1: .*put it back"),
        (2, b'{"trial": 1, "rows": [{}]}', "rows.jsonl:2: .*its trial runs again"),
    ],
)
def test_an_invalid_line_is_named(undisturbed, tmp_path, number, line, words):
    folder = make(tmp_path / "kill")
    lines = (undisturbed / ROWS).read_bytes().splitlines()
    lines[number - 1] = line
    (folder / ROWS).write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(CheckFailed, match=words):
        run_simulated(load(folder))


def test_a_study_with_all_trials_skipped_has_no_report(tmp_path):
    folder = make(tmp_path / "kill")
    with open_rows(load(folder), write=True) as rows:
        rows.begin({}, simulated=False)
        rows.add(1, [])
    with pytest.raises(CheckFailed, match="skipped"):
        write_report(load(folder))


@pytest.mark.parametrize(
    "words", [["--workers", "-3"], ["--workers", "0"], ["--workers", "2", "--scheduler", "tcp://x"]]
)
def test_invalid_numbers_of_workers_are_refused(tmp_path, words, capsys):
    assert run(["study", "run", str(make(tmp_path / "kill")), *words]) == 2


def test_ctrl_c_names_the_command_to_continue(undisturbed, tmp_path, monkeypatch, capsys):
    folder = make(tmp_path / "kill")
    lines = (undisturbed / ROWS).read_bytes().splitlines(keepends=True)
    (folder / ROWS).write_bytes(b"".join(lines[:3]))
    monkeypatch.setattr(simulate, "run", lambda job: (_ for _ in ()).throw(KeyboardInterrupt))
    assert run(["study", "resume", str(folder), "--workers", "1"]) == 130
    said = capsys.readouterr().err
    assert "2 of 4" in said and f"./coglab study resume {folder}" in said


def test_primitive_delivery_and_feedback_reach_the_world():
    with coglab.World(seed=1, person="patient", perfect_perception=True) as world:
        chosen = {
            "primitive": {"receive": "reach_human_high"},
            "delivery": "handle_first",
            "feedback": ["ee_admittance"],
        }
        settings.apply(world, chosen)
        world.step(0.1)
        entry = world.virtual_trial.ctx.database.get_object("mug").result()
        assert entry["dmp"]["receive"] == "reach_human_high" and entry["dmp"]["give"] == "give_human"
        assert world.feedback.is_enabled("ee_admittance") and world.feedback.get_execution_order()[0] == "ee_admittance"


def test_own_files_act_and_the_recording_names_the_participant(tmp_path):
    folder = make(tmp_path / "kill", YAML.replace("record: false\n", "").replace("participants: 2", "participants: 1"))
    (folder / "objects").mkdir()
    mug = package_path("coglab_objects", "objects", "mug.yaml").read_text()
    (folder / "objects" / "my_mug.yaml").write_text(
        mug.replace("id: mug", "id: my_mug").replace("reach_human", "reach_me")
    )
    library = package_path("coglab_controllers", "config", "primitives.xml").read_text()
    (folder / "primitives.xml").write_text(library.replace('id="reach_human"', 'id="reach_me"'))
    text = (folder / "study.yaml").read_text().replace("  natural: {timing: natural, speed: 0.8}\n", "")
    (folder / "study.yaml").write_text(text + "object: my_mug\n")
    assert run_simulated(load(folder), workers=1)["succeeded"] == 1
    (place,) = find_trials(folder / "recordings")
    record = TrialRecord.load(place)
    assert (record.participant, record.condition, record.study, record.object) == ("P01", "calm", "kill", "my_mug")
    assert coglab.Trial.load(place).results[0].ok


class StubSystem:
    """Records the conditions of a live session without applying them to the test's World."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def apply(self, condition):
        self.calls.append(condition)

    def announce(self, trial, session):
        self.calls.append(f"{trial.participant} {trial.condition}")

    def note(self, text):
        self.calls.append(text)

    def restore(self):
        self.calls.append("restored")


def test_a_live_session_with_notes_repetition_and_resume(tmp_path, capsys):
    text = YAML.replace("[receive]", "[receive, give]").replace("simulated:", "questionnaires: [nasa_tlx]\nsimulated:")
    folder, system = make(tmp_path / "kill", text), StubSystem()
    with coglab.World(seed=3, person="accustomed", perfect_perception=True) as world:
        lines = iter(["what", "n looked away", "", "", *["50"] * 5, "skip", "r", "", "n let go early", "l", "q"])
        data = session(load(folder), world.robot, lambda _: system, "P02", lambda prompt: next(lines))
    assert (data["trials"], data["trials_now"], data["handovers"], data["succeeded"]) == (1, 1, 2, 2)
    first = system.calls[1]
    assert system.calls == ["looked away", first, *[f"P02 {first}"] * 4, "let go early", "restored"]
    with open_rows(load(folder)) as rows:
        assert [(row["attempt"], row["notes"]) for row in rows.table()] == [(2, "let go early")] * 2
    assert b"looked away" in (folder / ROWS).read_bytes()
    with pytest.raises(CheckFailed, match="live trials"):
        run_simulated(load(folder))


def test_between_live_trials_the_object_is_given_back(tmp_path):
    folder = make(tmp_path / "kill")
    with coglab.World(seed=3, person="accustomed", perfect_perception=True) as world:
        lines = iter(["", "", "g", "", "q"])  # the second Enter is refused: the hand is full
        data = session(load(folder), world.robot, lambda _: StubSystem(), "P02", lambda prompt: next(lines))
    assert (data["trials_now"], data["succeeded"]) == (2, 2)


def test_a_later_session_asks_what_is_open_and_its_last_trial_is_repeated(tmp_path, capsys):
    text = YAML.replace("[receive]", "[receive, give]").replace("simulated:", "questionnaires: [nasa_tlx]\nsimulated:")
    folder, system = make(tmp_path / "kill", text), StubSystem()
    with open_rows(load(folder), write=True) as rows:
        rows.begin({}, simulated=False)
        (first, second) = [trial for trial in load(folder).trials() if trial.participant == "P01"]
        row = {
            "participant": "P01",
            "condition": first.condition,
            "action": "receive",
            "outcome": "",
            "reason_code": "",
        }
        rows.add(first.number, [{**row, "block": 1, "success": 0}])
    with coglab.World(seed=3, person="accustomed", perfect_perception=True) as world:
        lines = iter(["", *["50"] * 6, "", "l", "r", "", "l", "n good", "r", "s", "l", ""])
        session(load(folder), world.robot, lambda _: system, "P01", lambda prompt: next(lines))
    with open_rows(load(folder)) as rows:
        assert [(row["attempt"], row["notes"]) for row in rows.trials[second.number]] == [(2, "good")] * 2
    assert run(["study", "status", str(folder)]) == 0
    assert "1 of 2" in capsys.readouterr().out


def test_a_second_session_leaves_the_files_of_the_first_alone(tmp_path, capsys):
    folder = make(tmp_path / "kill")
    study = load(folder)
    with open_rows(study, write=True):
        write_machines(study, study.conditions["calm"])
        before = machines_file(study).read_bytes()
        assert run(["study", "run", str(folder), "--live", "--json"]) == 2
        assert machines_file(study).read_bytes() == before
    assert "another process" in json.loads(capsys.readouterr().out)["error"]


def test_json_is_alone_on_stdout_when_questions_are_asked(tmp_path, capsys, monkeypatch):
    text = YAML.replace("simulated:", "questionnaires: [nasa_tlx]\nsimulated:")
    monkeypatch.setattr("sys.stdin", io.StringIO("101\n50\n" + "skip\n" * 11))
    assert run(["study", "ask", "P01", str(make(tmp_path / "kill", text)), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"answers": 1}
