"""Services and latched topics of a running ROS system, spoken over the socket: nothing is imported from ROS (that takes
0.3 s and more on a busy computer), and no node is registered with the master. Python's own library alone.

The protocol is TCPROS: a header of `name=value` fields, then messages; each is preceded by its length (uint32).
"""

from __future__ import annotations

import socket
import struct
import time
import xmlrpc.client
from typing import Any
from urllib.parse import urlparse

CALLER = "/coglab_ask"
ANY_TYPE = "*"  # as checksum and type: whatever the other side has


class NoAnswer(Exception):
    """Master, node or service is not there, or did not answer in time."""


def master_call(master: str, method: str, *words: object) -> Any:
    """A call of the master's XML-RPC API, or of a node's: its value. NoAnswer where there is none."""
    try:
        code, sentence, value = getattr(xmlrpc.client.ServerProxy(master), method)(CALLER, *words)
    except (OSError, xmlrpc.client.Error, ValueError, TypeError) as error:
        raise NoAnswer(f"{master} does not answer ({error})") from error
    if code != 1:
        raise NoAnswer(str(sentence))
    return value


def text(value: str) -> bytes:
    """A string as ROS sends it."""
    data = value.encode()
    return struct.pack("<I", len(data)) + data


class Reader:
    """Takes one value after the other out of a message."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, kind: str) -> Any:
        """A number or bool by its code of the module struct."""
        (value,) = struct.unpack_from("<" + kind, self._data, self._at)
        self._at += struct.calcsize("<" + kind)
        return value

    def string(self) -> str:
        """A string."""
        size = self.take("I")
        self._at += size
        return self._data[self._at - size : self._at].decode(errors="replace")

    def strings(self) -> list[str]:
        """A list of strings."""
        return [self.string() for _ in range(self.take("I"))]

    def header(self) -> None:
        """Passes over a std_msgs/Header."""
        for _ in range(3):  # seq, stamp
            self.take("I")
        self.string()


class Connection:
    """One connection to a service or to the publisher of a topic."""

    def __init__(self, host: str, port: int, limit: float, **fields: str) -> None:
        """`fields`: of the header that is sent. NoAnswer where nobody answers within `limit` s, or who does refuses."""
        self._buffer = b""
        try:
            self._socket = socket.create_connection((host, port), limit)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            words = {"callerid": CALLER, "md5sum": ANY_TYPE, "type": ANY_TYPE, **fields}
            self.send(b"".join(text(f"{name}={value}") for name, value in words.items()))
        except OSError as error:
            raise NoAnswer(f"{host}:{port} cannot be reached ({error})") from error
        answer = self.message(limit)
        if answer is None:
            raise NoAnswer(f"{host}:{port} did not answer within {limit:.0f} s")
        if b"error=" in answer:
            raise NoAnswer(answer[answer.index(b"error=") + 6 :].decode(errors="replace"))

    def send(self, data: bytes) -> None:
        """Sends a message."""
        self._socket.sendall(struct.pack("<I", len(data)) + data)

    def read(self, size: int, limit: float) -> bytes | None:
        """The next `size` bytes; None if they are not here within `limit` s. NoAnswer where the connection ended."""
        end = time.monotonic() + limit
        while len(self._buffer) < size:
            self._socket.settimeout(max(1e-3, end - time.monotonic()))
            try:
                more = self._socket.recv(65536)
            except TimeoutError:
                return None
            except OSError as error:
                raise NoAnswer(str(error)) from error
            if not more:
                raise NoAnswer("the connection ended")
            self._buffer += more
        data, self._buffer = self._buffer[:size], self._buffer[size:]
        return data

    def message(self, limit: float) -> bytes | None:
        """The next message; None if it is not here within `limit` s."""
        head = self.read(4, limit)
        if head is None:
            return None
        (size,) = struct.unpack("<I", head)
        body = self.read(size, max(limit, 1.0))
        if body is None:
            raise NoAnswer("a message was cut short")
        return body

    def close(self) -> None:
        """Ends it."""
        self._socket.close()


def call(master: str, service: str, request: bytes, limit: float) -> Reader:
    """The response of a service, `limit` s for each step of the way. NoAnswer without one."""
    place = urlparse(master_call(master, "lookupService", service))
    connection = Connection(str(place.hostname), int(place.port or 0), limit, service=service)
    try:
        connection.send(request)
        fine = connection.read(1, limit)
        body = connection.message(limit) if fine is not None else None
    finally:
        connection.close()
    if fine is None or body is None:
        raise NoAnswer(f"no response within {limit:.0f} s")
    if fine != b"\x01":
        raise NoAnswer(body.decode(errors="replace"))
    return Reader(body)


def subscribe(master: str, topic: str, limit: float) -> Connection:
    """A connection to the first publisher of a topic; a latched message comes first. NoAnswer where there is none.

    The publisher is asked directly: the master does not learn of this subscriber.
    """
    publishers = dict(master_call(master, "getSystemState")[0]).get(topic, [])
    if not publishers:
        raise NoAnswer(f"nobody publishes {topic}")
    node = master_call(master, "lookupNode", publishers[0])
    _, host, port = master_call(node, "requestTopic", topic, [["TCPROS"]])
    return Connection(host, int(port), limit, topic=topic)
