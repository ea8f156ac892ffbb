"""./coglab with faults: one clear sentence, the next step, and nothing incomplete."""

import os
import platform
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from test_choose_smach import function

TOP = Path(__file__).resolve().parents[4]
ABSENT = "coglab-test-no-such-package"
HERE = platform.freedesktop_os_release().get("VERSION_CODENAME")


def run(*command: object, **environment: str) -> subprocess.CompletedProcess:
    """Runs a command in this environment with some variables changed; output and errors as one text in `stdout`."""
    words = [str(word) for word in command]
    return subprocess.run(
        words,
        env={**os.environ, **environment},
        text=True,
        timeout=600,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
    )


def needs(*command: str) -> pytest.MarkDecorator:
    """Skip if the command that prepares the fault does not run (no root, or a restricted container)."""
    works = shutil.which(command[0]) and subprocess.run(command, capture_output=True, check=False).returncode == 0
    return pytest.mark.skipif(
        not works, reason=f"`{' '.join(command)}` does not run here: not root, or a restricted container"
    )


@pytest.fixture
def checkout():
    """The command and a package list with a package that is not installed, in a folder that everybody can read."""
    folder = Path(tempfile.mkdtemp(prefix="coglab-command-"))
    folder.chmod(0o777)
    shutil.copy(TOP / "coglab", folder)
    (folder / "debian-packages.txt").write_text(f"run: {ABSENT}\nbuild: {ABSENT}\n")
    for path in folder.iterdir():
        path.chmod(0o755)  # independent of the umask of this checkout
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def workspace(checkout):
    """A checkout whose packages are all installed, with only coglab_bringup in its workspace."""
    (checkout / "debian-packages.txt").write_text("run: bash\nbuild: bash\n")
    sources = checkout / "catkin_ws" / "src"
    sources.mkdir(parents=True)
    shutil.copytree(
        TOP / "catkin_ws" / "src" / "coglab_bringup",
        sources / "coglab_bringup",
        ignore=shutil.ignore_patterns("test", "__pycache__", "launch"),
    )
    (sources / "coglab_bringup" / "launch").mkdir()
    return checkout


def lines_of(text: str) -> list[str]:
    return [line for line in text.splitlines() if "error:" in line]


@needs("unshare", "--net", "true")
def test_no_network(checkout):
    lists_before = sorted(os.listdir("/var/lib/apt/lists"))
    ended = run("unshare", "--net", checkout / "coglab", "build")
    assert ended.returncode == 1
    (error,) = lines_of(ended.stdout)
    assert "mirror" in error and "network" in error
    assert sorted(os.listdir("/var/lib/apt/lists")) == lists_before
    assert not (checkout / "catkin_ws").exists()


@needs("setpriv", "--reuid=65534", "--clear-groups", "true")
def test_no_root(checkout):
    ended = run("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", checkout / "coglab", "demo")
    assert ended.returncode == 1
    (error,) = lines_of(ended.stdout)
    assert "sudo" in error and f"apt-get install --no-install-recommends {ABSENT}" in error
    assert sorted(path.name for path in checkout.iterdir()) == ["coglab", "debian-packages.txt"]


@needs("unshare", "--mount", "true")
def test_wrong_release(checkout):
    """Its Python may be too old for this project."""
    package = checkout / "catkin_ws" / "src" / "coglab_bringup" / "src" / "coglab_bringup"
    package.mkdir(parents=True)
    (package / "arguments.py").write_text("raise TypeError('this Python is too old')\n")
    other = checkout / "os-release"
    other.write_text('PRETTY_NAME="Ubuntu 20.04"\nVERSION_CODENAME=focal\n')
    script = 'mount --bind "$1" "$(readlink -f /etc/os-release)" && exec "$2" test'
    ended = run("unshare", "--mount", "sh", "-c", script, "sh", other, checkout / "coglab")
    assert ended.returncode == 1
    (error,) = lines_of(ended.stdout)
    assert "bookworm" in error and "trixie" in error and "Ubuntu 20.04" in error and "docker/run" in error
    assert not (checkout / ".coglab").exists()


APT_GET = """#!/bin/sh
umask >"$LOGS/umask"
case "$*" in
  *indextargets*) . /etc/os-release; echo "$VERSION_CODENAME Debian:1.2/this"; printf '%s\n' "$APT_SUITE" ;;
  *" -s install "*) [ -n "$PLAN" ] && printf "$PLAN\n" ;;
  *install*) touch "$LOGS/installed"; printf "$REPORT"; echo "E: You have held broken packages."; exit 100 ;;
  *update*) printf "$UPDATE"; [ -z "$UPDATE" ] ;;
esac
"""
APT_CACHE = """#!/bin/sh
case "$*" in *" show chosen") printf 'Package: chosen\nInstalled-Size: %s\nSize: %s\n' $SIZES ;; esac
"""
CHOSEN = "Inst chosen (1-2 Debian:1.2/this [amd64])"


def with_fake_apt(checkout, **variables: str) -> tuple[str, str, bool]:
    """./coglab build with an apt-get that installs nothing: what it prints, its error, whether it began to install."""
    fakes = {"apt-get": APT_GET, "apt-cache": APT_CACHE, "dpkg": "#!/bin/sh\nprintf '%s' \"$BROKEN\"\n"}
    for name, text in fakes.items():
        (checkout / name).write_text(text)
        (checkout / name).chmod(0o755)
    script = 'umask 077; for tool in apt-get apt-cache dpkg; do mount --bind "$1/$tool" /usr/bin/$tool; done'
    script += '; [ -z "$SMALL_VAR" ] || mount -t tmpfs -o size=1m small /var; exec "$1/coglab" build'
    none = dict.fromkeys(("APT_SUITE", "PLAN", "REPORT", "UPDATE", "BROKEN", "SMALL_VAR"), "")
    environment = {**none, "SIZES": "1 1", "LOGS": str(checkout), **variables}
    ended = run("unshare", "--mount", "sh", "-c", script, "sh", checkout, **environment)
    assert ended.returncode == 1 and (checkout / "umask").read_text() == "0022\n"
    (error,) = lines_of(ended.stdout)
    return ended.stdout, error, (checkout / "installed").exists()


@needs("unshare", "--mount", "true")
@pytest.mark.parametrize(
    "variables, advice",
    [
        ({"APT_SUITE": "sid Debian:$(VERSION)/unstable"}, "/etc/apt also names sid"),
        ({"BROKEN": "bash"}, "dpkg --configure -a"),
        ({}, "by hand: apt-get"),
    ],
)
def test_packages_that_cannot_be_installed(checkout, variables, advice):
    """An incomplete upgrade of Debian or of a package is named; the caller's umask 077 does not affect Debian's
    packages."""
    shown, error, installed = with_fake_apt(checkout, **variables)
    assert advice in error and "held broken packages" in shown and installed


@needs("unshare", "--mount", "true")
@pytest.mark.parametrize(
    "suite, source",
    [
        ("other Debian:13.1/stable", "Debian:13.1/stable"),
        ("sid Debian:$(VERSION)/unstable", "Debian:unstable"),
        ("other-security Debian-Security:13/stable-security", "Debian-Security:13/stable-security"),
    ],
)
def test_packages_of_another_release_are_not_installed(checkout, suite, source):
    """Else an entry of a later Debian would upgrade half of this machine, and might remove packages."""
    plan = f"{CHOSEN}\nInst libc6 [2.36-9] (2.41-12 {source} [amd64])"
    _, error, installed = with_fake_apt(checkout, APT_SUITE=suite, PLAN=plan)
    assert f"would take 1 from another, such as libc6 from {suite.split()[0]}: " in error and HERE in error
    assert "/etc/apt" in error and not installed


@needs("unshare", "--mount", "true")
@pytest.mark.parametrize(
    "suite, source",
    [
        ("other Debian:13.1/stable", "Debian:1.2/this"),  # pinned low: apt-get takes nothing of it
        ("other Debian:13.1/stable", "Debian:13.1/stable, Debian:1.2/this"),  # the same version is in both
        (f"{HERE}-updates Debian:1-updates/this-updates", "Debian:1-updates/this-updates"),
        (f"{HERE}-security Debian-Security:1/this-security", "Debian-Security:1/this-security"),
        ("", "Debian Backports:this-backports"),
        ("", "packages.of.a.vendor"),
    ],
)
def test_packages_of_this_release_and_of_vendors_are_installed(checkout, suite, source):
    _, error, installed = with_fake_apt(
        checkout, APT_SUITE=suite, PLAN=f"Inst libc6 [2.36-9] (2.41-12 {source} [amd64])"
    )
    assert installed and "to go on by hand" in error


@needs("unshare", "--mount", "true")
@pytest.mark.parametrize(
    "sizes, small, message",
    [
        ("10240000000 1048576", "", "needs 13000001 MB, and /usr has "),
        ("0 20971520", "yes", "needs 20 MB, and /var has "),
    ],
)
def test_packages_that_do_not_fit_are_not_installed(checkout, sizes, small, message):
    """apt-get itself only looks at the room for its downloads."""
    _, error, installed = with_fake_apt(checkout, PLAN=CHOSEN, SIZES=sizes, SMALL_VAR=small)
    assert message in error and "make room" in error and not installed


NO_SPACE = " cannot copy extracted data for './usr/x' to '/usr/x.dpkg-new': failed to write (No space left on device)"


@needs("unshare", "--mount", "true")
@pytest.mark.parametrize("report", [NO_SPACE, "E: You don't have enough free space in /var/cache/apt/archives/."])
def test_a_disk_that_fills_while_packages_are_installed_is_named(checkout, report):
    _, error, installed = with_fake_apt(checkout, PLAN=CHOSEN, REPORT=report + "\n", BROKEN="bash")
    assert installed and report.strip() in error and "disk is full" in error and "dpkg --configure -a" in error


@needs("unshare", "--mount", "true")
def test_a_source_that_fails_is_named(checkout):
    """Not only a mirror of Debian may fail."""
    failed = "E: Failed to fetch https://vendor.example/InRelease  403 Forbidden"
    shown, error, installed = with_fake_apt(checkout, UPDATE=f"W: an old key\nErr:3 https://vendor.example\n{failed}\n")
    assert failed in shown and "Debian mirror" not in error and not installed
    assert "every source in /etc/apt must answer" in error and "network" in error and "run this again" in error


PIP_WITHOUT_NETWORK = """#!/bin/sh
case "$*" in *"-m pip install"*) echo "ERROR: no distribution of $NAME"; exit 1 ;; esac
exec /usr/bin/python3 "$@"
"""


def test_oracles_that_cannot_be_downloaded_are_skipped_with_a_sentence(checkout):
    """The tests that do not need them run."""
    for name in ("test-oracles.txt", "extras.txt"):
        (checkout / name).write_text("numpy\n")
    fake = checkout / "venv" / "bin" / "python"
    fake.parent.mkdir(parents=True)
    fake.write_text(PIP_WITHOUT_NETWORK)
    fake.chmod(0o755)
    make = "/usr/bin/python3 -m venv"
    assert make in function("oracle_python")
    script = f"""set -euo pipefail
        say() {{ echo "$*" >&2; }}
        top={checkout} state={checkout}
        {function("oracle_python").replace(make, "true")}
        "$(oracle_python)" -c 'print("tests run")'
        """
    ended = run("bash", "-c", script, NAME=ABSENT)
    assert ended.returncode == 0 and "tests run" in ended.stdout
    assert f"no distribution of {ABSENT}" in ended.stdout and "skipped" in ended.stdout


def test_path_with_a_space(checkout, tmp_path):
    folder = tmp_path / "my robot"
    shutil.copytree(checkout, folder)
    ended = run(folder / "coglab", "build")
    assert ended.returncode == 1 and f"'{folder}'" in lines_of(ended.stdout)[0]
    assert sorted(path.name for path in folder.iterdir()) == ["coglab", "debian-packages.txt"]


@needs("unshare", "--mount", "true")
def test_full_disk(workspace, tmp_path):
    script = (
        'mount -t tmpfs -o size=20m small "$1" && cp -r "$2/." "$1" && "$1/coglab" build; ls -A "$1" "$1/catkin_ws"'
    )
    ended = run("unshare", "--mount", "sh", "-c", script, "sh", tmp_path, workspace)
    (error,) = lines_of(ended.stdout)
    assert "300 MB" in error and f"{tmp_path}/catkin_ws" in error
    assert ".coglab" not in ended.stdout and ended.stdout.splitlines()[-1] == "src"


def test_doctor_names_a_missing_package_and_its_command(checkout):
    doctor = TOP / "catkin_ws/src/coglab_bringup/src/coglab_bringup/doctor.py"
    ended = run("/usr/bin/python3", "-I", doctor, checkout)
    assert ended.returncode == 1
    assert ABSENT in ended.stdout and "./coglab install run" in ended.stdout
    assert "./coglab build" in ended.stdout


def test_a_foreign_ros_is_named_and_not_used():
    ended = run(TOP / "coglab", "help", ROS_PACKAGE_PATH="/opt/ros/noetic/share")
    assert ended.returncode == 0 and "/opt/ros" in ended.stdout
    ended = run(TOP / "coglab", "doctor", ROS_PACKAGE_PATH="/opt/ros/noetic/share")
    assert re.search("/opt/ros.*ROS_PACKAGE_PATH", ended.stdout)


def test_an_unknown_command_is_named():
    ended = run(TOP / "coglab", "lunch")
    assert ended.returncode == 2 and "'lunch'" in ended.stdout and "./coglab launch" in ended.stdout


def test_occupied_port():
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        ended = run(sys.executable, "-m", "coglab_bringup.launch", "-p", port, COGLAB_TOP=str(TOP))
    assert ended.returncode == 1
    assert f"port {port}" in ended.stdout and "-p" in ended.stdout


def test_a_build_that_fails_without_the_word_error(workspace):
    folder = workspace / "catkin_ws" / "build"
    folder.mkdir()
    (folder / ".built_by").write_text("catkin build")  # catkin_make refuses it with its own message
    ended = run(workspace / "coglab", "build")
    assert ended.returncode == 1
    assert "previously built by 'catkin build'" in ended.stdout
    assert ".log" in ended.stdout.splitlines()[-1]


CATKIN_MAKE = """#!/bin/sh
[ -e build/CMakeCache.txt ] && echo "old build: kept" || echo "old build: gone"
exit 1
"""


@needs("unshare", "--mount", "true")
@pytest.mark.parametrize(
    "release, moved, end", [(HERE, "", "kept"), ("sarge", "", "gone"), (None, "", "gone"), (HERE, "/before", "gone")]
)
def test_only_a_build_of_this_release_and_folder_is_kept(workspace, release, moved, end):
    """cmake refuses a build of another folder. One of another release fails later, with other messages."""
    tool = workspace / "catkin_make"
    tool.write_text(CATKIN_MAKE)
    tool.chmod(0o755)
    build = workspace / "catkin_ws" / "build"
    build.mkdir()
    (build / "CMakeCache.txt").write_text(f"CMAKE_CACHEFILE_DIR:INTERNAL={moved}{build.resolve()}\n")
    (workspace / ".coglab").mkdir()
    if release:
        (workspace / ".coglab" / "release").write_text(f"{release}\n")
    script = 'mount --bind "$1" /usr/bin/catkin_make && exec "$2" build'
    ended = run("unshare", "--mount", "sh", "-c", script, "sh", tool, workspace / "coglab")
    assert f"old build: {end}" in ended.stdout, ended.stdout


def test_nothing_is_built_when_no_source_is_newer():
    log = TOP / ".coglab" / "build.log"
    if not (TOP / ".coglab" / "built.all").is_file():
        pytest.skip("this workspace was not built by ./coglab")
    before = log.stat().st_mtime_ns
    ended = run(TOP / "coglab", "shell", "true")
    assert ended.returncode == 0 and "building" not in ended.stdout and log.stat().st_mtime_ns == before


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="builds a workspace: ./coglab test --long")
def test_a_newer_source_is_built_and_data_is_not(workspace):
    package = workspace / "catkin_ws" / "src" / "coglab_bringup"
    coglab = workspace / "coglab"
    assert "building" in run(coglab, "shell", "true").stdout
    assert "building" not in run(coglab, "shell", "true").stdout
    (package / "launch" / "new.launch").write_text("<launch/>")
    (package / "src" / "coglab_bringup" / "demo.py").write_text("changed = True\n")
    assert "building" not in run(coglab, "shell", "true").stdout
    for change in (
        lambda: (package / "src" / "new.cpp").touch(),
        lambda: os.utime(package / "CMakeLists.txt", (1, 1)),
        lambda: (package / "src" / "new.cpp").unlink(),
    ):
        change()
        assert "building" in run(coglab, "shell", "true").stdout
        assert "building" not in run(coglab, "shell", "true").stdout
    assert "building" in run(coglab, "build").stdout  # an explicit build always builds


def test_the_template_of_a_controller_is_named_as_the_runner_expects(tmp_path):
    from coglab_bringup.arguments import Wanted
    from coglab_bringup.test_runner import find_programs

    package = TOP / "catkin_ws" / "src" / "ctrl_more"
    target = tmp_path / "catkin_ws" / "src"
    target.mkdir(parents=True)
    (tmp_path / "coglab").touch()
    made = run(sys.executable, package / "scripts" / "new_controller.py", "WristDamper", "--into", target)
    assert made.returncode == 0 and "./coglab build && ./coglab test wrist_damper" in made.stdout
    (program,) = find_programs(tmp_path, tmp_path, sys.executable, [Wanted("wrist_damper")])
    cmake = (target / "wrist_damper" / "CMakeLists.txt").read_text()
    assert f"set(test_target {program.name})" in cmake and "test/test_controller.cpp" in cmake


def test_a_run_reuses_its_home_and_never_shares_it(tmp_path):
    from coglab_bringup.run_directory import lasting_home

    first, lock = lasting_home(tmp_path)
    second, other = lasting_home(tmp_path)
    assert first != second
    os.close(lock)
    again, lock = lasting_home(tmp_path)
    assert again == first  # with the held object, and without waiting for the other run
    os.close(lock)
    os.close(other)
