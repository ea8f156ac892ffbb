"""docker/run and docker/test, with an engine that only records its calls."""

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
    """The docker folder in its own checkout, and an engine of that name."""

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
            timeout=600,
            check=False,
        )

    def asked(self) -> list[list[str]]:
        """Calls of the engine, without queries."""
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
def test_run_builds_the_present_sources_and_runs_the_command(checkout, words, command):
    """The image is never an old one. Only the demo's results are visible outside."""
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
    assert ended.returncode == 2 and "bookworm trixie" in ended.stderr
    assert not checkout.log.exists()


def test_exit_status_and_message_show_the_failure(checkout):
    assert checkout.run("run", ENGINE_RUN="3").returncode == 3
    checkout.log.unlink()
    ended = checkout.run("test", ENGINE_BUILD="1")
    assert ended.returncode == 71 and "image" in ended.stderr
    assert [call[0] for call in checkout.asked()] == ["build"], "nothing runs without an image"


def test_a_missing_engine_is_reported_with_a_remedy(checkout):
    tools = checkout.tools
    (tools / "docker").unlink()
    for name in ("bash", "env", "dirname", "readlink", "mkdir", "timeout"):
        (tools / name).symlink_to(shutil.which(name))
    ended = checkout.run("run", path=str(tools))
    assert ended.returncode == 69 and "apt-get install" in ended.stderr and "podman" in ended.stderr
