"""The Tab key of bash completes ./coglab."""

import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
BASH = """
eval "$(./coglab completion)"
compopt() { :; }  # it works only in a real completion
COMP_LINE=$1 COMP_POINT=${#1} COMP_TYPE=9
read -ra COMP_WORDS <<<"$1x"
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
last=${COMP_WORDS[COMP_CWORD]%x}
COMP_WORDS[COMP_CWORD]=$last
_coglab "${COMP_WORDS[0]}" "$last" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("./coglab st", {"start", "status", "stop", "study"}),
        ("./coglab study re", {"report", "resume"}),
        ("./coglab study run --work", {"--workers"}),
    ],
)
def test_tab_completes_commands_verbs_and_options(line, words):
    pytest.importorskip("argcomplete")
    done = subprocess.run(["bash", "-c", BASH, "bash", line], cwd=TOP, capture_output=True, text=True, timeout=600)
    assert set(done.stdout.split()) == words, done.stderr
