"""Runs a command such that nothing of it outlives it, however it ends: process_tree.py COMMAND [ARG ...]

Two processes of this file stand above the command. The one that was started (the front) keeps its process id and does
nothing but wait. Its child (the keeper) is the parent of the command. Both are subreapers (prctl(2)): a process of the
command that forks twice, or opens a session of its own as every node of roslaunch does, becomes a child of the keeper
when its parent ends, so that the tree below the keeper holds all of them. The keeper ends that tree when the command
has ended, when it is told to (SIGTERM, SIGINT, SIGHUP, SIGQUIT), and when the front was killed; the front ends it when
the keeper was killed. Only processes of this tree are ever signalled.

A signal is passed on to the command at once; whatever is left is asked by SIGINT, then by SIGTERM, then killed. What a
terminal sends on Ctrl-C reaches the command itself, which may take its time: roslaunch asks its nodes, an
interpreter goes on.

Needs nothing but Python's own library: ./coglab uses it before anything is built.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h
SI_KERNEL = 128  # siginfo_t.si_code of what a terminal sends; it reaches the whole foreground group
ENDING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
TOLD = ((0.8, signal.SIGINT), (1.5, signal.SIGTERM), (2.2, signal.SIGKILL))  # s after the order to end: what all get
LEFT_OVER = ((0.0, signal.SIGINT), (0.6, signal.SIGTERM), (1.2, signal.SIGKILL))  # s after the command's own end
AT_ONCE = ((0.0, signal.SIGKILL),)
KILL_LIMIT = 5.0  # s after SIGKILL until it is said what cannot be killed
COULD_NOT_START = 127


def _prctl(option: int, value: int) -> None:
    if ctypes.CDLL(None, use_errno=True).prctl(option, value, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), f"prctl({option}) failed")


def _parents() -> dict[int, int]:
    """Parent of every process that runs; zombies are left out, they wait for their parent alone."""
    parents = {}
    for entry in os.listdir("/proc"):
        if not entry.isdigit():
            continue
        try:
            fields = Path("/proc", entry, "stat").read_bytes().rpartition(b")")[2].split()
        except OSError:
            continue  # it has ended meanwhile
        if fields[0] != b"Z":
            parents[int(entry)] = int(fields[1])
    return parents


def descendants(root: int) -> list[int]:
    """All processes below `root`, which is not part of them."""
    children: dict[int, list[int]] = {}
    for process, parent in _parents().items():
        children.setdefault(parent, []).append(process)
    found, ahead = [], [root]
    while ahead:
        below = children.get(ahead.pop(), [])
        found += below
        ahead += below
    return found


def processor_time(root: int) -> float:
    """s that the processes below `root` which run now have used, with those that they have waited for."""
    ticks = 0
    for process in descendants(root):
        try:
            fields = Path("/proc", str(process), "stat").read_bytes().rpartition(b")")[2].split()
        except OSError:
            continue
        ticks += sum(int(field) for field in fields[11:15])
    return ticks / os.sysconf("SC_CLK_TCK")


def _reap() -> dict[int, int]:
    """Statuses of the children that have ended, by process id."""
    ended: dict[int, int] = {}
    while True:
        try:
            process, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return ended
        if process == 0:
            return ended
        ended[process] = os.waitstatus_to_exitcode(status)


def _send(sign: signal.Signals, processes: Sequence[int]) -> None:
    for process in processes:
        try:
            os.kill(process, sign)
        except (ProcessLookupError, PermissionError):
            pass  # it has ended, or belongs to root: then sudo passes the signal on


class _Ending:
    """The end of all processes below this one, by steps: (seconds after now, signal that all of them get)."""

    def __init__(self, steps: Sequence[tuple[float, signal.Signals]]) -> None:
        self._begin = time.monotonic()
        self._ahead = list(steps)
        self._limit = steps[-1][0] + KILL_LIMIT

    def step(self) -> list[int]:
        """Sends what is due, in the last step again and again, since a process may fork; returns who is left."""
        left = descendants(os.getpid())
        passed = time.monotonic() - self._begin
        while self._ahead and passed >= self._ahead[0][0]:
            _send(self._ahead[0][1], left)
            if len(self._ahead) == 1:
                break
            self._ahead.pop(0)
        return left

    def finish(self) -> None:
        """Returns when none is left; what cannot be killed is named."""
        while left := self.step():
            if time.monotonic() - self._begin > self._limit:
                print(f"[coglab] error: these processes could not be ended: {left}", file=sys.stderr)
                return
            time.sleep(0.02)
            _reap()


def _from_terminal(heard: signal.struct_siginfo) -> bool:
    """Whether it is Ctrl-C, which the command gets from the terminal, too, and answers as it likes."""
    return heard.si_code == SI_KERNEL and heard.si_signo in (signal.SIGINT, signal.SIGQUIT)


def _shell_status(status: int) -> int:
    """As a shell says it: 128 + signal for what a signal ended."""
    return 128 - status if status < 0 else status


def _heard_signals() -> set[signal.Signals]:
    """What front and keeper wait for; under nohup, SIGHUP ends nothing."""
    ending = {sign for sign in ENDING if sign != signal.SIGHUP or signal.getsignal(sign) != signal.SIG_IGN}
    return {*ending, signal.SIGCHLD}


def _start(command: list[str], mask: set[int | signal.Signals]) -> int:
    """The process id of the command, with the signal mask that we were started with; 127 if it cannot start."""
    process = os.fork()
    if process:
        return process
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        os.execvp(command[0], command)
    except OSError as error:
        print(f"[coglab] error: {command[0]} cannot be run: {error.strerror}", file=sys.stderr, flush=True)
    os._exit(COULD_NOT_START)


def _keep(command: list[str], front: int, mask: set[int | signal.Signals], signals: set[signal.Signals]) -> int:
    """Waits for the command, or for the order to end it; ends all of its tree; returns the exit status."""
    _prctl(PR_SET_CHILD_SUBREAPER, 1)
    _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != front:  # it ended before we asked to be told
        return 1
    child = _start(command, mask)
    status, ending = None, None
    while status is None:
        heard = signal.sigtimedwait(signals, 3600.0 if ending is None else 0.05)
        if heard and heard.si_signo in ENDING and not _from_terminal(heard):
            _send(signal.Signals(heard.si_signo), [child])
            ending = ending or _Ending(TOLD)
        if ending:
            ending.step()
        status = _reap().get(child)
    (ending or _Ending(LEFT_OVER)).finish()
    return _shell_status(status)


def main(command: list[str]) -> int:
    """Front: starts the keeper, hands on signals, and ends the tree itself should the keeper be killed."""
    if not command:
        print(f"usage: {__doc__.splitlines()[0]}", file=sys.stderr)
        return 2
    signals = _heard_signals()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    _prctl(PR_SET_CHILD_SUBREAPER, 1)
    front = os.getpid()
    keeper = os.fork()
    if keeper == 0:
        status = 1
        try:
            status = _keep(command, front, mask, signals)
        finally:
            os._exit(status)
    while True:
        heard = signal.sigwaitinfo(signals)
        if heard.si_signo in ENDING and not _from_terminal(heard):
            _send(signal.Signals(heard.si_signo), [keeper])
        ended = _reap().get(keeper)
        if ended is not None:
            _Ending(AT_ONCE).finish()  # nothing is left, unless the keeper was killed
            return _shell_status(ended)


def above(command: Sequence[str]) -> list[str]:
    """The command line that runs `command` below this file."""
    return [sys.executable, "-I", __file__, *command]


def run(command: Sequence[str], limit: float, **options: Any) -> int | None:
    """Runs a command of ours such that nothing of it outlives this call: its exit status, None if `limit` (s) ended it.

    `options` go to subprocess.Popen. An exception here (Ctrl-C) ends the command, too.
    """
    process = subprocess.Popen(above(command), **options)
    try:
        return process.wait(limit)
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(TOLD[-1][0] + 2 * KILL_LIMIT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
