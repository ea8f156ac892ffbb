"""./coglab bench mutants [PACKAGE ...] [--seed N]: would the tests notice a slip of the hand?

Over how many: 12 changes or more in each of ten packages, the seven with a core (bridge, controllers, ctrl_more, hand,
engine, brain, cell), and coglab_rt, coglab_objects and coglab_py, to which code of these has moved since 5828bb3, drawn
over all lines of code of the package that ship, templates and programs without an ending among them (mutator.py:
comparison, sign, constant, condition, dropped exit, swapped arguments; what is left alone there, and why, it says);
fewer make the row missed. Each is made alone, what it touches is built, and the tests of the package and of what stands
on it run until the first red one. What is left out, and counted in a row beside: a line that does not compile, which is
drawn again, and a test that is red on the unchanged sources, too. Survivors with which the program does the same are
named, with a reason, in docs/equivalent_mutants.json, shown, and subtracted from the row over all packages alone, as
long as they are at most one in twenty of all; in the row of its package each counts as a survivor.

The seed of a package comes from the last commit that touched its folder, and changes with each one that does: a row
says it, and nobody can choose among seeds. A seed given by hand is that of all packages, and is only printed. It was
one seed of the whole checkout's commit, so that any commit threw away what takes hours; the lines over which one draws
and the tests that judge are as they were, neither milder. docs/figures.md has the rows of all packages with these
seeds, of sources that were committed and stayed the same, and no others.

All of it happens in a copy of the checkout below .coglab/mutants: the checkout itself is never changed, however this
ends. A red test is run once more before it is believed, and one that was never seen green is run on the unchanged
sources first. Tests of format, types, pages and figures do not judge (mutant_workspace.NO_JUDGES). What a run has found
is kept: the same command goes on where it was ended, as long as the sources are the same, those of the mutator and of
what judges among them. Hours; run only when named.
With --own the tests of the package alone judge, which is quicker and harder: what survives may be killed by what stands
on it, so that the share is a lower bound, and its rows say so. What they have judged `./coglab bench --report` keeps in
docs/mutants.json, from which another machine goes on (mutants_kept.py); it builds only what it has to judge. The
mutator is our own, not a kept tool: cosmic-ray and mutmut know Python alone, and here one way of drawing goes over all
shipped lines of C++ and Python alike, with an incremental build behind each.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import random
import sys
import time
from collections.abc import Callable, Container
from dataclasses import asdict
from pathlib import Path

from coglab_bringup import bench, figures, test_runner
from coglab_bringup.arguments import CORES, mutants_options, needs_of, package_folders
from coglab_bringup.commit import folder_seed
from coglab_bringup.mutant import Equivalent, Mutant, read_equivalent, sentence, told
from coglab_bringup.mutant_rows import rows_of
from coglab_bringup.mutant_workspace import Workspace
from coglab_bringup.mutants_kept import entry_of, further, mutants_of, own_seeds, read_state, rows_of_state, write_whole
from coglab_bringup.mutator import Change, changes, code_lines, is_python, is_source
from coglab_bringup.sources import MUTANTS, sources_of
from coglab_bringup.usage import Refused

NOT_SHIPPED = {"test", "bench"}
SLOWER = 4.0
"""by which a test may take longer than it did on the unchanged sources before it counts as one that hangs"""


def shipped(folder: Path) -> list[Path]:
    """The source files of a package that ship, in a fixed order: C++ and Python, templates of them and programs without
    an ending, too; not its tests and benches, and not setup.py, which says where files lie."""
    return sorted(
        path
        for path in folder.rglob("*")
        if not (NOT_SHIPPED | {"__pycache__"}) & set(path.relative_to(folder).parts[:-1])
        and path.name != "setup.py"
        and is_source(path)
    )


def draw(folder: Path, dice: random.Random, without: Container[tuple[Path, Change]] = ()) -> tuple[Path, Change] | None:
    """One change, of a line drawn over all lines of code of a package; lines that offer none but those `without` are
    drawn again. None if there is no such line."""
    lines = []
    for path in shipped(folder):
        lines += [(path, number) for number in code_lines(path.read_text(encoding="utf-8"), path.name)]
    while lines:
        path, number = lines.pop(dice.randrange(len(lines)))
        offered = [c for c in changes(path.read_text(encoding="utf-8"), path.name) if c.line == number]
        offered = [change for change in offered if (path, change) not in without]
        if offered:
            return path, dice.choice(offered)
    return None


def standing_on(package: str, folders: dict[str, Path]) -> list[str]:
    """The packages that need `package`, directly or not, the nearest first."""
    needs = needs_of(folders)
    found: list[str] = []
    front = {package}
    while front:
        front = {name for name in folders if needs[name] & front and name not in (*found, package)}
        found += sorted(front)
    return found


class Times:
    """Of each test program: s that it takes where it is green, or None if the unchanged sources turn it red."""

    def __init__(self, workspace: Workspace, own: str = "") -> None:
        """`own`: the package whose tests alone judge; empty: those of all."""
        self._file = workspace.root.parent / (f"times.{own}.json" if own else "times.json")
        self._digest = workspace.digest_of(own) if own else workspace.digest
        self._known: dict[str, float | None] = {}
        try:
            state = json.loads(self._file.read_text())
            self._known = state["times"] if state["digest"] == self._digest else {}
        except (OSError, ValueError, KeyError, TypeError):
            pass

    def knows(self, name: str) -> bool:
        """Whether it has been seen green, or red on the unchanged sources."""
        return name in self._known

    def of(self, name: str) -> float | None:
        """Its time, s; None: it tells nothing."""
        return self._known[name]

    def red(self) -> list[str]:
        """Those that tell nothing, because the unchanged sources turn them red."""
        return [name for name, seconds in self._known.items() if seconds is None]

    def keep(self, name: str, seconds: float | None) -> None:
        """Remembers it for the next run, whole or not at all."""
        self._known[name] = seconds
        write_whole(self._file, {"digest": self._digest, "times": self._known})


class Campaign:
    """The mutants of one package, drawn with one seed; goes on where it was ended."""

    def __init__(
        self,
        workspace: Workspace,
        package: str,
        seed: int,
        times: Times,
        say: Callable[[str], None] = print,
        own: bool = False,
    ) -> None:
        self.workspace, self.package, self.times, self.say = workspace, package, times, say
        self.folders = package_folders(workspace.root / "catkin_ws" / "src")
        self.dice = random.Random(f"{package} {seed}")
        self.folder, self.own = self.folders[package], own
        self.judges = [package] if own else [package, *standing_on(package, self.folders)]
        self.kept = workspace.root.parent / f"{package}.{seed}{'.own' if own else ''}.json"
        self.digest = workspace.digest_of(package) if own else workspace.digest
        self.fallen: list[tuple[Path, Change]] = []  # of the drawn, those that the dice have given
        entry = entry_of(workspace.root, package, seed, self.digest) if own else {}
        here = rows_of_state(read_state(self.kept), self.digest)
        self.drawn = mutants_of(further(entry.get("drawn", []), here))  # None: did not compile
        self._red_elsewhere: list[str] = entry.get("red", [])

    def red(self) -> list[str]:
        """Tests that tell nothing, here or where others have judged before."""
        return [*self.times.red(), *self._red_elsewhere]

    def mutants(self) -> list[Mutant]:
        """Those judged so far."""
        return [mutant for mutant in self.drawn if mutant is not None]

    def keep(self) -> None:
        """Writes what is known, whole or not at all."""
        rows = [asdict(mutant) if mutant else None for mutant in self.drawn]
        write_whole(self.kept, {"digest": self.digest, "drawn": rows})

    def run(self, count: int) -> None:
        """Draws and judges until there are `count` mutants."""
        if self.drawn:
            self.say(f"{self.package}: {len(self.mutants())} were judged before")
        ready = False
        while len(self.mutants()) < count:
            drawn = draw(self.folder, self.dice, self.fallen)
            if drawn is None:
                if not self.mutants():
                    raise Refused(f"{self.package} holds no line of C++ or Python that could be changed")
                self.say(f"{self.package}: there are no more than {len(self.mutants())} changes")
                return
            path, change = drawn
            self.fallen.append(drawn)
            if len(self.fallen) <= len(self.drawn):  # judged before: the dice fall as they did
                continue
            if not ready:
                self.workspace.ready(self.say)
                ready = True
            mutant = self.judge(path, change)
            self.drawn.append(mutant)
            self.keep()
            if mutant is None:
                self.say(f"{self.package}: {path.name}:{change.line} does not compile; drawn again")
            else:
                by = f" by {mutant.by}" if mutant.by else ""
                self.say(f"{self.package} {len(self.mutants())}/{count}: {sentence(mutant)}: {mutant.verdict}{by}")

    def judge(self, path: Path, change: Change) -> Mutant | None:
        """What the tests say of one change; None if it does not compile. The file is as before afterwards."""
        text, since = path.read_text(encoding="utf-8"), time.monotonic()
        file = str(path.relative_to(self.workspace.root))
        texts = (text, change.apply(text))
        line, after = (each.splitlines()[change.line - 1].strip() for each in texts)
        changed = Edited(self.workspace, path, texts, self.folder if self.own else None)
        try:
            if not changed.enter():
                return None
            by = self.first_red(changed)
        finally:
            changed.leave()
        verdict = "killed" if by else "survived"
        seconds = round(time.monotonic() - since, 1)
        what = (change.line, change.kind, change.before, change.after)
        return Mutant(self.package, file, *what, line, after, verdict, by, seconds)

    def first_red(self, changed: Edited) -> str:
        """Package and name of the first test that is red; empty if none is."""
        for program in self.workspace.programs(self.judges):
            name = f"{program.package}/{program.name}"
            known = self.times.knows(name)
            usual = self.times.of(name) if known else None
            if known and usual is None:
                continue
            limit = test_runner.TIME_LIMIT if usual is None else SLOWER * usual + 30.0
            if not self._red_twice(program, limit):
                if not known:
                    self.times.keep(name, program.seconds)
                continue
            if known or self._green_unchanged(program, name, changed):
                return name
        return ""

    def _red_twice(self, program: test_runner.Program, limit: float) -> bool:
        """A crowded machine can turn any test red, by a time limit if by nothing else."""
        return self.workspace.red(program, limit) and self.workspace.red(program, limit)

    def _green_unchanged(self, program: test_runner.Program, name: str, changed: Edited) -> bool:
        """Whether a test that the change turns red is green without it; the change is back where it is not."""
        changed.leave()
        self.workspace.build(changed.alone)
        green = not self._red_twice(program, test_runner.TIME_LIMIT)
        self.times.keep(name, program.seconds if green else None)
        if not green:
            self.say(f"{name} is red on the unchanged sources and tells nothing: it is left out")
            changed.enter()
        return green


class Edited:
    """One file of the copy with its change in, or out again."""

    def __init__(self, workspace: Workspace, path: Path, texts: tuple[str, str], alone: Path | None) -> None:
        self._workspace, self._path, (self._before, self._after) = workspace, path, texts
        self._compiled = not is_python(self._before, path.name)
        self.alone = alone
        """The package that is built for it; None: all."""

    def enter(self) -> bool:
        """Puts the change in and builds what it touches; whether that compiles."""
        if not self._compiled and self._workspace.stale:
            self._workspace.build(self.alone)
        self._path.write_text(self._after, encoding="utf-8")
        return not self._compiled or self._workspace.build(self.alone)

    def leave(self) -> None:
        """The file as it was; what is built from it is stale until the next build."""
        if self._path.read_text(encoding="utf-8") != self._before:
            self._path.write_text(self._before, encoding="utf-8")
            self._workspace.stale = self._workspace.stale or self._compiled


def recorded(
    top: Path, options: argparse.Namespace, seeds: dict[str, int], rows: list[dict], before: dict[str, str]
) -> bool:
    """Keeps the rows for docs/figures.md where nobody has chosen packages or seed, and the sources, which were
    committed, are as they were `before`, each package with its last commit."""
    chosen = bool(options.packages) or options.seed is not None or own_seeds(top, list(seeds)) != seeds
    return not chosen and bool(before["sources"]) and figures.record(top, MUTANTS, rows, False, before)


def judged(top: Path, options: argparse.Namespace, seeds: dict[str, int]) -> list[Campaign]:
    """The campaigns of the packages, run to their ends."""
    workspace = Workspace(top)
    every = Times(workspace)
    campaigns = [
        Campaign(workspace, each, seed, Times(workspace, each) if options.own else every, say, options.own)
        for each, seed in seeds.items()
    ]
    for campaign in campaigns:
        campaign.run(options.count)
    return campaigns


def print_result(rows: list[dict], seeds: dict[str, int], survived: list[Mutant], named: list[Equivalent]) -> None:
    """The table, and each survivor in a line below it."""
    bench.print_table(rows)
    drawn = ", ".join(f"{package} {seed}" for package, seed in seeds.items())
    print(f"\nseeds: {drawn}; {len(survived)} survived" + (":" if survived else ""))
    for what, why in told(survived, named):
        print(f"  {what}{why}")


def say(text: str) -> None:
    """One line of progress."""
    print(f"[coglab] mutants: {text}", file=sys.stderr, flush=True)


def main(arguments: list[str]) -> int:
    """Exit status 0 if every row is ok, 1 if one is not, 2 if it cannot be run."""
    top = Path(os.environ["COGLAB_TOP"])
    try:
        options = mutants_options(top, arguments)
        named = read_equivalent(top)
        lock = (top / ".coglab").resolve() / "mutants.lock"
        lock.parent.mkdir(exist_ok=True)
        holder = lock.open("w")
        try:
            fcntl.flock(holder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Refused("another `bench mutants` of this checkout runs; wait for it, or end it") from None
        folders, packages = package_folders(top / "catkin_ws" / "src"), options.packages or list(CORES)
        given = options.seed is not None
        seeds = {each: options.seed if given else folder_seed(top, folders[each]) for each in packages}
        before = sources_of(top, MUTANTS)
        campaigns = judged(top, options, seeds)
    except KeyboardInterrupt:
        say("ended; what was judged is kept, and the same command goes on from there")
        return 130
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    red = sorted({name for each in campaigns for name in each.red()})
    rows = rows_of({each.package: each.drawn for each in campaigns}, seeds, named, red, options.own)
    found = [mutant for campaign in campaigns for mutant in campaign.mutants()]
    print_result(rows, seeds, [mutant for mutant in found if mutant.verdict == "survived"], named)
    if not recorded(top, options, seeds, rows, before):
        say("only printed: docs/figures.md has rows of all packages, their own seeds and their unchanged sources")
    if options.json:
        content = {"seeds": seeds, "rows": rows, "mutants": [asdict(mutant) for mutant in found]}
        options.json.write_text(json.dumps(content, indent=1) + "\n")
    return 0 if all(row["ok"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
