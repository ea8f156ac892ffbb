"""Every definition of this package: a sentence has a code beside it, a comment says what it is, CMake generates it."""

import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
DEFINITIONS = sorted(path for kind in ("msg", "srv", "action") for path in (PACKAGE / kind).glob(f"*.{kind}"))
STRING = re.compile(r"^string(\[\])?\s+(\w+)\s*(#|$)")
SENTENCES = set("message reason why text fault pause_reasons waits_for problems status".split())
NO_SENTENCES = set(
    """
    action actions activity active_controller active_type affected causes condition control_mode controller
    controller_id controller_ids controller_type controller_types delivery fri_state frame_id from_state hand held_by
    holding id mode motion name names next_event object_frame object_id object_ids outcome participant path pattern
    phalanges phase primitive_id profile quality signal source stage state supervisor to_state type units waiting_for
    yaml
    """.split()
)
"""Strings that are a name, one of a few words that the comment lists, or YAML; `causes` stand behind a reason that has
the code."""
CODE = re.compile(r"^uint16(\[\])?\s+\w*code\w*\s*#\s*(\S.*)$")
OWN_CODE = {"Say.msg"}
"""its code has values of its own: what is said is no reason"""


def sections(path: Path) -> list[list[str]]:
    """The parts between the lines of dashes: one in a message, two in a service, three in an action."""
    parts: list[list[str]] = [[]]
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.strip() == "---":
            parts.append([])
        else:
            parts[-1].append(line)
    return parts


def answers(path: Path) -> list[list[str]]:
    """The parts that programs get as an answer: what is asked for may hold the free text of whoever asks."""
    parts = sections(path)
    return parts if path.suffix == ".msg" else parts[1:]


@pytest.mark.parametrize("path", DEFINITIONS, ids=lambda path: path.name)
def test_a_sentence_has_a_code_beside_it(path: Path) -> None:
    for part in answers(path):
        strings = [match for line in part if (match := STRING.match(line))]
        unknown = [match[2] for match in strings if match[2] not in SENTENCES | NO_SENTENCES]
        assert not unknown, f"{path.name}: are {unknown} sentences, or names? Put them into one of the sets above"
        sentences = [match for match in strings if match[2] in SENTENCES]
        codes = [
            match for line in part if (match := CODE.match(line)) if "ReasonCode" in match[2] or path.name in OWN_CODE
        ]
        for array in (None, "[]"):
            wanted = [match[2] for match in sentences if match[1] == array]
            found = [match[0] for match in codes if match[1] == array]
            assert len(found) >= len(wanted), (
                f"{path.name}: each of {wanted} needs a field uint16{array or ''} of "
                f"its own whose comment names ReasonCode; found {found}"
            )


@pytest.mark.parametrize("path", DEFINITIONS, ids=lambda path: path.name)
def test_a_definition_says_what_it_is(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines and lines[0].startswith("# "), f"{path.name}: its first line is a comment that says what it is"


def test_every_file_is_generated() -> None:
    listed = set(re.findall(r"^\s+(\w+\.(?:msg|srv|action))\)?$", (PACKAGE / "CMakeLists.txt").read_text(), re.M))
    assert listed == {path.name for path in DEFINITIONS}


def test_numbers_of_reason_codes_are_unique() -> None:
    text = (PACKAGE / "msg" / "ReasonCode.msg").read_text()
    constants = re.findall(r"^uint16 (\w+)=(\d+)", text, re.M)
    numbers = [int(number) for _, number in constants]
    assert len(numbers) > 40 and len(set(numbers)) == len(numbers) and numbers == sorted(numbers)
