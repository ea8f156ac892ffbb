"""Client for services and latched topics of a running ROS system, directly on sockets. Standard library only: importing
ROS takes 0.3 s or more on a busy computer. It registers no node with the master.

The protocol is TCPROS: a header of `name=value` fields, then messages. Each has its length (uint32) in front.
"""

from __future__ import annotations

import socket
import struct
import time
import xmlrpc.client
from typing import Any
from urllib.parse import urlparse

CALLER = "/coglab_ask"
ANY_TYPE = "*"  # checksum and type that match every service and topic


class NoAnswer(Exception):
    """Master, node or service does not exist, or did not answer in time."""


def master_call(master: str, method: str, *words: object) -> Any:
    """Value returned by the XML-RPC API of the master or of a node. NoAnswer if there is none."""
    try:
        code, sentence, value = getattr(xmlrpc.client.ServerProxy(master), method)(CALLER, *words)
    except (OSError, xmlrpc.client.Error, ValueError, TypeError) as error:
        raise NoAnswer(f"{master} does not answer ({error})") from error
    if code != 1:
        raise NoAnswer(str(sentence))
    return value


def text(value: str) -> bytes:
    """A string in the format of ROS messages."""
    data = value.encode()
    return struct.pack("<I", len(data)) + data


class Reader:
    """Reads the values of a message one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, kind: str) -> Any:
        """Next number or bool. `kind` is its format code in the module struct."""
        (value,) = struct.unpack_from("<" + kind, self._data, self._at)
        self._at += struct.calcsize("<" + kind)
        return value

    def string(self) -> str:
        """Next string."""
        size = self.take("I")
        self._at += size
        return self._data[self._at - size : self._at].decode(errors="replace")

    def strings(self) -> list[str]:
        """Next list of strings."""
        return [self.string() for _ in range(self.take("I"))]

    def header(self) -> None:
        """Skip a std_msgs/Header."""
        for _ in range(3):  # seq, stamp
            self.take("I")
        self.string()


class Connection:
    """One connection to a service or to the publisher of a topic."""

    def __init__(self, host: str, port: int, limit: float, **fields: str) -> None:
        """`fields` are sent in the header. NoAnswer if the peer does not answer within `limit` s or refuses."""
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
        """Send a message."""
        self._socket.sendall(struct.pack("<I", len(data)) + data)

    def read(self, size: int, limit: float) -> bytes | None:
        """Next `size` bytes; None if they do not arrive within `limit` s. NoAnswer if the connection has ended."""
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
        """Next message; None if it does not arrive within `limit` s."""
        head = self.read(4, limit)
        if head is None:
            return None
        (size,) = struct.unpack("<I", head)
        body = self.read(size, max(limit, 1.0))
        if body is None:
            raise NoAnswer("a message was cut short")
        return body

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def call(master: str, service: str, request: bytes, limit: float) -> Reader:
    """Response of a service, with a limit of `limit` s for each step. NoAnswer if there is none."""
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
    """Connection to the first publisher of a topic. A latched message arrives first. NoAnswer if there is no publisher.

    The publisher is contacted directly: the master does not register this subscriber.
    """
    publishers = dict(master_call(master, "getSystemState")[0]).get(topic, [])
    if not publishers:
        raise NoAnswer(f"nobody publishes {topic}")
    node = master_call(master, "lookupNode", publishers[0])
    _, host, port = master_call(node, "requestTopic", topic, [["TCPROS"]])
    return Connection(host, int(port), limit, topic=topic)
