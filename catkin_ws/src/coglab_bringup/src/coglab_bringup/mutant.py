"""One changed line of `./coglab bench mutants`, what became of it, and the list of those that change nothing."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from coglab_bringup.usage import Refused

EQUIVALENT = "docs/equivalent_mutants.json"
ALONE = ", by the package's own tests alone"
"""what a row says, and no other, whose lines nothing but these tests has judged: --own"""


@dataclass
class Mutant:
    """One changed line and what became of it."""

    package: str
    file: str
    line: int
    kind: str
    before: str
    after: str
    text: str  # the line as it ships, without the blanks at its ends
    changed: str  # the same, as changed
    verdict: str  # killed, survived
    by: str  # the test program that was red first
    seconds: float


@dataclass(frozen=True)
class Equivalent:
    """A change with which the program does the same, so that no test can notice it, and the reason why it does."""

    file: str
    line: str  # the whole text of the line
    change: str  # the whole text of the line as changed
    reason: str

    def is_of(self, mutant: Mutant) -> bool:
        """Whether it speaks of this mutant; one that a test has noticed is none."""
        here = (mutant.file, mutant.text, mutant.changed) == (self.file, self.line, self.change)
        return here and mutant.verdict == "survived"


def read_equivalent(top: Path) -> list[Equivalent]:
    """The kept list; Refused, with what is wrong, if it cannot be read or has an entry without a reason."""
    path = top / EQUIVALENT
    try:
        named = [Equivalent(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, TypeError) as error:
        raise Refused(f"{path}: expected a list of {{file, line, change, reason}}: {error}") from error
    for entry in named:
        if not all(isinstance(text, str) and text.strip() for text in vars(entry).values()):
            raise Refused(f"{path}: {entry.file}: expected four texts, and a reason that says something")
    return named


def named_equivalent(mutants: list[Mutant], named: list[Equivalent]) -> list[tuple[Mutant, Equivalent]]:
    """The mutants that the list names; each entry names one."""
    found: list[tuple[Mutant, Equivalent]] = []
    for entry in named:
        taken = [mutant for mutant, _ in found]
        found += [(m, entry) for m in mutants if entry.is_of(m) and not any(m is other for other in taken)][:1]
    return found


def sentence(mutant: Mutant) -> str:
    """File, line and change."""
    after = mutant.after or "nothing"
    return f"{mutant.file}:{mutant.line}: {mutant.kind}: '{mutant.before}' -> '{after}'"


def told(survived: list[Mutant], named: list[Equivalent]) -> list[tuple[str, str]]:
    """Of each survivor: file, line and change; and the reason, if it is named equivalent."""
    reasons = {id(mutant): f" (equivalent: {entry.reason})" for mutant, entry in named_equivalent(survived, named)}
    return [(sentence(mutant), reasons.get(id(mutant), "")) for mutant in survived]
