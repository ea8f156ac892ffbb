"""Runs a command such that nothing of it outlives it, however it ends: process_tree.py COMMAND [ARG ...]

Two processes of this file are above the command. The started process (the front) keeps its process id and only waits.
Its child (the keeper) is the parent of the command. Both are subreapers (prctl(2)): a process of the command that
forks twice, or that opens its own session like every node of roslaunch, becomes a child of the keeper when its parent
ends. So the tree below the keeper contains all processes of the command. The keeper ends this tree when the command has
ended, when it receives SIGTERM, SIGINT, SIGHUP or SIGQUIT, and when the front was killed. The front ends the tree when
the keeper was killed. Only processes of this tree are signalled.

A signal is passed on to the command at once. The remaining processes receive SIGINT, then SIGTERM, then SIGKILL. Ctrl-C
in a terminal reaches the command directly, and the command may take its time: roslaunch ends its nodes, an interpreter
continues.

Standard library only: ./coglab uses it before anything is built.
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
SI_KERNEL = 128  # siginfo_t.si_code of a terminal's signal, which reaches the whole foreground group
ENDING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
TOLD = ((0.8, signal.SIGINT), (1.5, signal.SIGTERM), (2.2, signal.SIGKILL))  # s after an ending signal: signal to all
LEFT_OVER = ((0.0, signal.SIGINT), (0.6, signal.SIGTERM), (1.2, signal.SIGKILL))  # s after the command ended by itself
AT_ONCE = ((0.0, signal.SIGKILL),)
KILL_LIMIT = 5.0  # s after SIGKILL until the processes that survive it are reported
COULD_NOT_START = 127  # exit status


def _prctl(option: int, value: int) -> None:
    if ctypes.CDLL(None, use_errno=True).prctl(option, value, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), f"prctl({option}) failed")


def _parents() -> dict[int, int]:
    """Parent of every running process, by process id. Without zombies, which only wait for their parent."""
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
    """All processes below `root`, without `root`."""
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
    """Processor time (s) of the running processes below `root` and of their children that have ended."""
    ticks = 0
    for process in descendants(root):
        try:
            fields = Path("/proc", str(process), "stat").read_bytes().rpartition(b")")[2].split()
        except OSError:
            continue
        ticks += sum(int(field) for field in fields[11:15])
    return ticks / os.sysconf("SC_CLK_TCK")


def _reap() -> dict[int, int]:
    """Wait statuses of the children that have ended, by process id."""
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
            pass  # it has ended, or it belongs to root (then sudo passes the signal on)


class _Ending:
    """Ends all processes below this one in steps: (s after the start, signal to all of them)."""

    def __init__(self, steps: Sequence[tuple[float, signal.Signals]]) -> None:
        self._begin = time.monotonic()
        self._ahead = list(steps)
        self._limit = steps[-1][0] + KILL_LIMIT

    def step(self) -> list[int]:
        """Send the signal that is due; return the remaining processes. The last signal repeats: a process may fork."""
        left = descendants(os.getpid())
        passed = time.monotonic() - self._begin
        while self._ahead and passed >= self._ahead[0][0]:
            _send(self._ahead[0][1], left)
            if len(self._ahead) == 1:
                break
            self._ahead.pop(0)
        return left

    def finish(self) -> None:
        """Return when no process is left. Report processes that cannot be killed."""
        while left := self.step():
            if time.monotonic() - self._begin > self._limit:
                print(f"[coglab] error: these processes could not be ended: {left}", file=sys.stderr)
                return
            time.sleep(0.02)
            _reap()


def _from_terminal(heard: signal.struct_siginfo) -> bool:
    """True for Ctrl-C in a terminal. The command receives it, too, and reacts in its own way."""
    return heard.si_code == SI_KERNEL and heard.si_signo in (signal.SIGINT, signal.SIGQUIT)


def _shell_status(status: int) -> int:
    """Exit status as in a shell: 128 + signal number for a process that a signal ended."""
    return 128 - status if status < 0 else status


def _heard_signals() -> set[signal.Signals]:
    """Signals that front and keeper wait for. SIGHUP is excluded under nohup."""
    ending = {sign for sign in ENDING if sign != signal.SIGHUP or signal.getsignal(sign) != signal.SIG_IGN}
    return {*ending, signal.SIGCHLD}


def _start(command: list[str], mask: set[int | signal.Signals]) -> int:
    """Start the command with the original signal mask and return its process id. Exit status 127: it cannot start."""
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
    """Wait for the command or an ending signal, then end the whole tree. Returns the exit status."""
    _prctl(PR_SET_CHILD_SUBREAPER, 1)
    _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != front:  # it ended before PR_SET_PDEATHSIG was set
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
    """Front: start the keeper, pass signals on, and end the tree if the keeper was killed."""
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
            _Ending(AT_ONCE).finish()  # processes are left only if the keeper was killed
            return _shell_status(ended)


def above(command: Sequence[str]) -> list[str]:
    """Command line that runs `command` below this file."""
    return [sys.executable, "-I", __file__, *command]


def run(command: Sequence[str], limit: float, **options: Any) -> int | None:
    """Run a command so that none of its processes survives this call. Returns its exit status; None after `limit` s.

    `options` are passed to subprocess.Popen. An exception here (Ctrl-C) ends the command, too.
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
