"""The smach that ./coglab builds with, and changes of it. The tests run the functions of the script itself, with other
search paths."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
PACKAGES = ("smach", "smach_msgs", "smach_ros")


def function(name: str) -> str:
    """One function of the script."""
    found = re.search(rf"^{name}\(\) \{{.*?^\}}$", (TOP / "coglab").read_text(), re.MULTILINE | re.DOTALL)
    assert found, name
    return found.group(0)


def with_smach(prefix: Path, *packages: str) -> Path:
    for package in packages:
        (prefix / "share" / package).mkdir(parents=True)
        (prefix / "share" / package / "package.xml").write_text("<package/>")
    return prefix


class Script:
    """The functions in their own folder; they search only below `places`."""

    def __init__(self, folder: Path) -> None:
        self.workspace = folder / "catkin_ws"
        (self.workspace / "build").mkdir(parents=True)
        self.places = folder / "places"
        self.places.mkdir()

    def built_without(self, packages: str) -> None:
        (self.workspace / "build" / "CMakeCache.txt").write_text(f"CATKIN_BLACKLIST_PACKAGES:STRING={packages}\n")

    def run(self, command: str, ask: str = "") -> subprocess.CompletedProcess:
        """Choose smach like `./coglab COMMAND`. `ask`: commands before it, as in the branch of build."""
        places = "for prefix in /usr /opt/ros/*; do"
        find = function("find_upstream_smach")
        assert places in find
        find = find.replace(places, f"for prefix in {self.places}/*; do")
        text = f"""set -euo pipefail
            die() {{ echo "error: $*" >&2; exit 1; }}
            workspace={self.workspace} command={command}
            unset CMAKE_PREFIX_PATH
            {find}
            {function("choose_smach")}
            {ask}
            choose_smach
            echo "left out: $left_out; before: $was_left_out; path: ${{CMAKE_PREFIX_PATH:-}}"
            """
        return subprocess.run(["bash", "-c", text], text=True, capture_output=True, timeout=600, check=False)


@pytest.fixture
def script(tmp_path) -> Script:
    return Script(tmp_path)


OURS = "left out: ; before: {}; path: \n"
ASK = "upstream_smach=$(find_upstream_smach)"
ALL = ";".join(PACKAGES)


def test_upstream_smach_omits_ours_and_needs_all_three_packages_in_one_prefix(script):
    with_smach(script.places / "a", "smach", "smach_ros")
    whole = with_smach(script.places / "b", *PACKAGES)
    assert script.run("build", ASK).stdout == f"left out: {ALL}; before: ; path: {whole}\n"


def test_missing_upstream_smach_is_an_error(script):
    with_smach(script.places / "a", "smach", "smach_msgs")
    ended = script.run("build", ASK)
    assert ended.returncode == 1 and "smach_ros" in ended.stderr


def test_later_commands_use_the_last_build_and_a_plain_build_returns_to_ours(script):
    whole = with_smach(script.places / "noetic", *PACKAGES)
    script.built_without(ALL)
    assert script.run("demo").stdout == f"left out: {ALL}; before: {ALL}; path: {whole}\n"
    # The names differ: build() then removes the build with the other one.
    assert script.run("build").stdout == OURS.format(ALL)
    assert '[ "$was_left_out" = "$left_out" ] || rm -rf "$workspace/build" "$workspace/devel"' in function("build")


def upstream() -> bool:
    return any(
        all((prefix / "share" / package / "package.xml").is_file() for package in PACKAGES)
        for prefix in (Path("/usr"), *Path("/opt/ros").glob("*"))
    )


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="builds the whole workspace: ./coglab test --long")
@pytest.mark.skipif(not upstream(), reason="upstream's smach is not installed below /usr or /opt/ros")
def test_a_handover_on_upstreams_engine(tmp_path):
    ignore = shutil.ignore_patterns(".git", ".coglab", "build", "devel", "__pycache__")
    copy = shutil.copytree(TOP, tmp_path / "copy", symlinks=True, ignore=ignore)
    for words in (["build", "--upstream-smach"], ["demo", "--headless", "--seed", "7"]):
        ended = subprocess.run([copy / "coglab", *words], timeout=3600, check=False, stdout=sys.stderr)
        assert ended.returncode == 0, words
