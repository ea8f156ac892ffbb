"""The Python end of a slot of the robot's control cycle: shared memory, handed over by a local socket.

The robot creates and owns the memory; the socket shows the robot the end of this process. The fields are those of
coglab_controllers/remote/layout.hpp, and the checksum that of remote/shared_record.hpp.
"""

from __future__ import annotations

import array
import mmap
import os
import socket
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt

INTERFACE = 1
MOTION, FEEDBACK = 1, 2  # kinds of slots
REST, JOINTS, POSE, CORRECTION, GIVE_UP = 0, 1, 2, 3, 4  # kinds of answers; GIVE_UP: the controller failed
GREETING_TIME = 3.0  # s, longest wait for the robot's answer to the greeting

QUESTION = np.dtype(
    [(name, "<i8") for name in ("stamp_ns", "written_ns", "run", "running", "late", "refused", "cycle")]
    + [(name, "<f8") for name in ("dt", "time", "next")]
    + [(name, "<f8", (7,)) for name in ("joints", "joint_velocity", "joint_torque", "external_torque")]
    + [("wrench", "<f8", (6,)), ("hand", "<f8", (7,))]
    + [("from_joints", "<f8", (7,)), ("from_joint_velocity", "<f8", (7,))]
    + [("from_pose", "<f8", (7,)), ("from_twist", "<f8", (6,))]
    + [("reference_pose", "<f8", (7,)), ("reference_twist", "<f8", (6,))]
)
ANSWER = np.dtype(
    [("stamp_ns", "<i8"), ("run", "<i8"), ("kind", "<i8"), ("done", "<i8"), ("time", "<f8"), ("values", "<f8", (14,))]
)
HEAD = 16  # bytes before each record: its number and its checksum
ANSWER_AT = (HEAD + QUESTION.itemsize + 63) // 64 * 64
SIZE = (ANSWER_AT + HEAD + ANSWER.itemsize + 63) // 64 * 64

_WORD = (1 << 64) - 1
_START, _NUMBER, _FACTOR = 0x9E3779B97F4A7C15, 0xD6E8FEB86659FD93, 0xDA942042E4DD58B5


def _factors(count: int) -> npt.NDArray[np.uint64]:
    return np.array([pow(_FACTOR, i + 1, 1 << 64) for i in range(count)], dtype=np.uint64)


_FACTORS = _factors(max(QUESTION.itemsize, ANSWER.itemsize) // 8)


def checksum(words: npt.NDArray[np.uint64], number: int) -> int:
    """Checksum of a record (uint64 words) and its number."""
    return (_START + number * _NUMBER + int(np.dot(words, _FACTORS[: len(words)]))) & _WORD


class SlotError(RuntimeError):
    """No slot is available. The message has the reason and a remedy."""


class SlotTaken(SlotError):
    """Another process holds the slot."""


@dataclass(frozen=True)
class Address:
    """A slot that a robot of this user offers."""

    robot: int  # number of the robot's process
    slot: str  # id of its controller

    def __str__(self) -> str:
        """Name of the socket, without the leading zero."""
        return f"coglab/{os.getuid()}/{self.robot}/{self.slot}"


def offered() -> list[Address]:
    """All slots that robots of this user offer now."""
    found = set()
    for line in Path("/proc/net/unix").read_text(encoding="utf-8", errors="replace").splitlines()[1:]:
        name = line.rpartition(" ")[2]
        parts = name.split("/")
        if len(parts) == 4 and parts[0] == "@coglab" and parts[1] == str(os.getuid()) and parts[2].isdigit():
            found.add(Address(int(parts[2]), parts[3]))
    return sorted(found, key=lambda address: (address.robot, address.slot))


class Slot:
    """A connection to one slot. Use it in a `with` block; the end of the block lets go."""

    def __init__(self, address: Address, kind: int, interface: int = INTERFACE) -> None:
        """Connect. Raises SlotError if nobody offers the slot or the robot refuses this process."""
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._memory = self._greet(kind, interface)
        except BaseException:
            self._socket.close()
            raise
        words = np.frombuffer(self._memory, dtype=np.uint64)
        answer = words[ANSWER_AT // 8 :]
        self._question_words = words[: (HEAD + QUESTION.itemsize) // 8]
        self._answer_head = answer[: HEAD // 8]
        self._answer_words = answer[HEAD // 8 : (HEAD + ANSWER.itemsize) // 8]
        self._seen = 0
        self._number = time.monotonic_ns()  # differs from that of an earlier process

    def _greet(self, kind: int, interface: int) -> mmap.mmap:
        self._socket.settimeout(GREETING_TIME)
        try:
            self._socket.connect(b"\0" + str(self.address).encode())
            hello = f"coglab-slot {interface} {kind} {QUESTION.itemsize} {ANSWER.itemsize}"
            self._socket.send(hello.encode())
            text, control, _, _ = self._socket.recvmsg(1024, socket.CMSG_SPACE(4))
        except TimeoutError as error:
            raise SlotError(f"the robot (process {self.address.robot}) gave no answer for {GREETING_TIME} s") from error
        except OSError as error:
            raise SlotError(f"no robot offers the slot {self.address}: {error.strerror or error}") from error
        files = array.array("i")
        for level, what, data in control:
            if level == socket.SOL_SOCKET and what == socket.SCM_RIGHTS:
                files.frombytes(data[: len(data) // files.itemsize * files.itemsize])
        try:
            answer = text.decode(errors="replace")
            if answer != "welcome" or not files:
                kind_of_refusal, _, why = answer.partition(" ")
                why = why or "the robot closed the connection without an answer"
                raise SlotTaken(why) if kind_of_refusal == "taken" else SlotError(why)
            return mmap.mmap(files[0], SIZE)
        finally:
            for file in files:
                os.close(file)

    def __enter__(self) -> Slot:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go."""
        self.close()

    def close(self) -> None:
        """Let go: the robot fades a correction out, or brakes. The memory is freed with its last array."""
        self._socket.close()

    def alive(self) -> bool:
        """Return false when the robot has ended or has unloaded the slot."""
        self._socket.setblocking(False)
        try:
            return self._socket.recv(1) != b""
        except BlockingIOError:
            return True
        except OSError:
            return False

    def question(self) -> np.void | None:
        """Return the newest question, if it is whole and was not returned before; fields as in `QUESTION`."""
        number = int(self._question_words[0])
        if number == self._seen:
            return None
        copy = self._question_words.copy()
        number, words = int(copy[0]), copy[HEAD // 8 :]
        if int(copy[1]) != checksum(words, number):
            return None  # it is being written; the next call returns it
        self._seen = number
        record: np.void = words.view(QUESTION)[0]
        return record

    def answer(self, answer: npt.NDArray[np.void]) -> None:
        """Publish an answer: an array of one element of `ANSWER`."""
        words = answer.view(np.uint64)
        self._number += 1
        self._answer_head[1] = checksum(words, self._number)
        self._answer_head[0] = self._number
        self._answer_words[:] = words
