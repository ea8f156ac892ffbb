"""docker/run and docker/test, with an engine that only writes down what it is asked for."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
ENGINE = """#!/bin/sh
for word in "$@"; do printf '%s\\n' "$word"; done >>"$ENGINE_LOG"
echo "= end" >>"$ENGINE_LOG"
case $1 in
  build) exit "${ENGINE_BUILD:-0}" ;;
  run) exit "${ENGINE_RUN:-0}" ;;
  image) exit "${ENGINE_IMAGE:-0}" ;;
esac
"""
IN_CONTAINER = ["run", "--rm", "--network", "none", "--hostname", "localhost"]


class Checkout:
    """The docker folder in a checkout of its own, and an engine of that name."""

    def __init__(self, folder: Path) -> None:
        self.top, self.log = folder / "checkout", folder / "asked"
        shutil.copytree(TOP / "docker", self.top / "docker")
        self.tools = folder / "tools"
        self.tools.mkdir()
        (self.tools / "docker").write_text(ENGINE)
        (self.tools / "docker").chmod(0o755)

    def run(self, *words: str, path: str = "", **environment: str) -> subprocess.CompletedProcess:
        """Runs a script of the folder."""
        return subprocess.run(
            [self.top / "docker" / words[0], *words[1:]],
            env={"PATH": path or f"{self.tools}:{os.environ['PATH']}", "ENGINE_LOG": str(self.log), **environment},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )

    def asked(self) -> list[list[str]]:
        """What the engine was asked for, but for questions."""
        calls = [call.split("\n")[:-1] for call in self.log.read_text().split("= end\n") if call]
        return [call for call in calls if call[0] in ("build", "run")]


@pytest.fixture
def checkout(tmp_path):
    """A checkout with an engine."""
    return Checkout(tmp_path)


def expected_build(top: Path, suite: str = "bookworm") -> list[str]:
    image = ["--build-arg", f"SUITE={suite}", "-f", f"{top}/docker/Dockerfile", "-t", f"coglab:{suite}"]
    return ["build", "--network", "host", *image, str(top)]


@pytest.mark.parametrize(
    "words, command",
    [([], ["./coglab", "demo", "--headless"]), (["./coglab", "test", "a b"], ["./coglab", "test", "a b"])],
)
def test_run_builds_what_is_there_now_and_runs_the_command_in_it(checkout, words, command):
    """The image is never an old one; the demo's results are seen outside, and nothing else is."""
    for _ in range(2):
        checkout.log.unlink(missing_ok=True)
        ended = checkout.run("run", *words)
        assert ended.returncode == 0, ended.stderr
        mounted = ["-v", f"{checkout.top}/out:/coglab/out", "coglab:bookworm"]
        assert checkout.asked() == [expected_build(checkout.top), [*IN_CONTAINER, *mounted, *command]]
    assert (checkout.top / "out").is_dir()


def test_test_runs_the_tests_named_without_a_network(checkout):
    ended = checkout.run("test", "--suite", "trixie", "--long", "ctrl_more")
    assert ended.returncode == 0, ended.stderr
    tests = [*IN_CONTAINER, "coglab:trixie", "./coglab", "test", "--long", "ctrl_more"]
    assert checkout.asked() == [expected_build(checkout.top, "trixie"), tests]


@pytest.mark.parametrize("script, words", [("run", ["--suite", "focal"]), ("test", ["--suite"])])
def test_unknown_suite_is_named(checkout, script, words):
    ended = checkout.run(script, *words)
    assert ended.returncode == 2 and "there are: bookworm trixie" in ended.stderr
    assert not checkout.log.exists()


def test_how_they_end_says_what_happened(checkout):
    assert checkout.run("run", ENGINE_RUN="3").returncode == 3
    checkout.log.unlink()
    ended = checkout.run("test", ENGINE_BUILD="1")
    assert ended.returncode == 71 and "the image did not build" in ended.stderr
    assert [call[0] for call in checkout.asked()] == ["build"], "nothing runs in an image that is not there"


def test_without_an_engine_they_say_how_to_get_one(checkout):
    tools = checkout.tools
    (tools / "docker").unlink()
    for name in ("bash", "env", "dirname", "readlink", "mkdir", "timeout"):
        (tools / name).symlink_to(shutil.which(name))
    ended = checkout.run("run", path=str(tools))
    assert ended.returncode == 69 and "apt-get install" in ended.stderr and "podman" in ended.stderr
