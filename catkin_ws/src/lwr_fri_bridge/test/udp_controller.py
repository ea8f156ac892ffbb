"""A robot controller on UDP just large enough for the node's test: our own KRL convention."""

from __future__ import annotations

import socket
import threading
import time

import lwr_fri_bridge

IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
TURNED = [0, -1, 0, 0.5, 1, 0, 0, 0.1, 0, 0, 1, 0.4]  # the tool's x lies along the base's y

LONGEST_LOSS = 60
"""Cycles in a row without an answer, after which it leaves command mode. KUKA's controller leaves earlier. Later, the
bridge would no longer know the reflected answer, and would take this for a restart."""


class UdpController:
    """Runs in its own thread from start() to close()."""

    def __init__(self, port: int, period: float = 0.005) -> None:
        self.port, self.period = port, period
        self.own = [0.1, 0.5, -0.2, 1.0, 0.3, -0.4, 0.6]
        self.offset = [0.0] * 7
        self.state, self.control = 1, 1
        self.obeys, self.silent = True, False
        self.temperature = [30.0, 31.0, 32.0, 33.0, 34.0, 35.0, 36.0]
        self.answered = 0
        self.steps: list[float] = []  # largest joint step per cycle in command mode, rad
        self.requests: list[tuple[int, float]] = []  # request, largest step of the cycle before it
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._finished = self._counter = self._reflected = self._unanswered = 0
        self._running = True
        self._began = time.monotonic()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def position(self) -> list[float]:
        return [a + b for a, b in zip(self.own, self.offset, strict=True)]

    def start(self) -> UdpController:
        self._thread.start()
        return self

    def close(self) -> None:
        self._running = False
        self._thread.join(timeout=60.0)
        self._socket.close()

    def _run(self) -> None:
        due = time.monotonic()
        while self._running:
            if self.silent:
                time.sleep(self.period)
                due = time.monotonic()
                continue
            self._counter = (self._counter + 1) & 0xFFFF
            self._socket.sendto(
                lwr_fri_bridge.encode_measurement(
                    {
                        "counter": self._counter,
                        "reflected": self._reflected,
                        "size": 916,
                        "id": 0x2006,
                        "timestamp": time.monotonic() - self._began,
                        "state": self.state,
                        "quality": 3,
                        "control": self.control,
                        "power": 0x7F,
                        "measurement_period": self.period,
                        "command_period": self.period,
                        "measured_position": self.position,
                        "commanded_position": self.own,
                        "commanded_position_offset": self.offset,
                        "commanded_frame": IDENTITY,
                        "commanded_frame_offset": IDENTITY,
                        "measured_frame": TURNED,
                        "external_wrench": [1, 2, 3, 4, 5, 6],
                        "measured_torque": [1, 2, 3, 4, 5, 6, 7],
                        "external_torque": [7, 6, 5, 4, 3, 2, 1],
                        "temperature": self.temperature,
                        "latency": 0.0021,
                        "krl_ints": [self._finished, 1 if self._finished else 0] + [0] * 13 + [4010],
                    }
                ),
                ("127.0.0.1", self.port),
            )
            due += self.period
            self._unanswered += 1
            self._take_until(due)
            if self._unanswered > LONGEST_LOSS:
                self.state = 1
            time.sleep(max(0.0, due - time.monotonic()))

    def _take_until(self, due: float) -> None:
        """Takes the answer to the datagram just sent; late ones to earlier datagrams are dropped."""
        while (left := due - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                answer = lwr_fri_bridge.decode_command(self._socket.recv(2000))
            except (TimeoutError, ConnectionRefusedError):
                return
            if answer["reflected"] != self._counter:
                continue
            self._reflected = answer["counter"]
            self.answered += 1
            self._unanswered = 0
            step = max(abs(a - b) for a, b in zip(answer["joint_position"], self.position, strict=True))
            if self.state == 2:
                self.steps.append(step)
                self.offset = [a - b for a, b in zip(answer["joint_position"], self.own, strict=True)]
            request, strategy, number = answer["krl_ints"][:3]
            if self.obeys and number and number != self._finished and request in (1, 2):
                self._finished = number
                self.requests.append((request, step))
                self.state = 2 if request == 1 else 1
                self.control = strategy // 10
            return
