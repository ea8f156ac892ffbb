"""Start of the node: its port, one console per ROS master, a link that only its user can read."""

import asyncio
import socket
import stat
from types import SimpleNamespace

import pytest
from coglab_console.ros import startup
from coglab_console.ros.node import ConsoleNode
from coglab_console.ros.startup import StartError, bind, exposure, only_one
from coglab_console.web.access import Access


def taken_port() -> socket.socket:
    found = socket.socket()
    found.bind(("127.0.0.1", 0))
    found.listen()
    return found


def test_a_taken_default_port_gives_way_to_another():
    other = taken_port()
    port = other.getsockname()[1]
    found = bind("127.0.0.1", port, fixed=False)
    assert found.getsockname()[1] != port
    found.close()
    other.close()


def test_taken_requested_port_is_refused_with_a_message():
    other = taken_port()
    with pytest.raises(StartError, match="console_port"):
        bind("127.0.0.1", other.getsockname()[1], fixed=True)
    other.close()


def test_address_of_another_computer_is_refused():
    with pytest.raises(StartError, match="203.0.113.1"):
        bind("203.0.113.1", 0, fixed=True)


@pytest.mark.parametrize("address", ["0.0.0.0", "192.168.1.5", ""])
def test_another_address_than_loopback_is_warned_of(address):
    assert address in exposure(address) and "move the robot" in exposure(address)


def test_one_console_for_each_master(tmp_path, monkeypatch):
    monkeypatch.setattr(startup.time, "sleep", lambda seconds: None)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:11999")
    only_one(tmp_path)
    with pytest.raises(StartError, match="another console"):
        only_one(tmp_path)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:12000")
    only_one(tmp_path)


def test_only_the_user_can_read_the_link(tmp_path):
    said = []
    node = SimpleNamespace(
        address="127.0.0.1",
        port=8790,
        home=tmp_path,
        access=Access(["127.0.0.1:8790"]),
        say=lambda *words: said.append(words),
    )
    (tmp_path / "console.url").write_text("old")
    (tmp_path / "console.url").chmod(0o644)
    link = ConsoleNode.write_link(node)
    path = tmp_path / "console.url"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600 and path.read_text() == link + "\n"
    assert node.access.redeem(link.split("t=")[1]) is not None
    node.home = tmp_path / "gone"
    assert ConsoleNode.write_link(node).startswith("http://127.0.0.1:8790/?t=") and said


def test_calls_after_the_end_of_the_loop_are_ignored():
    loop = asyncio.new_event_loop()
    loop.close()
    ConsoleNode.soon(SimpleNamespace(loop=loop), print)
