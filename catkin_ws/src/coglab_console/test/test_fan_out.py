"""Events without gaps, few queued states: a reconnecting browser misses no event; one that never reads slows none."""

import asyncio
import json
import socket
import time

from coglab_console.desk.events import EventLog
from coglab_console.web.fan_out import WINDOW, Client, Documents, to_json
from console_double import running


def test_events_are_numbered_and_lost_ones_counted():
    log = EventLog(time.time, keep=10)
    for i in range(25):
        log.add("test", str(i))
    events, lost = log.since(5)
    assert [event["seq"] for event in events] == list(range(16, 26)) and lost == 10
    assert log.since(25) == ([], 0)
    assert len(log.since(99)[0]) == 10  # of a console that ran before
    assert len(log.since(-3)[0]) == 10
    assert len(log.add("test", "x" * 5000)["text"]) == 600


def test_a_slow_client_gets_the_newest_state_and_every_event():
    log, documents = EventLog(time.time), Documents()
    client = Client("a", 0, documents, log)
    documents.put("x", 1)
    for i in range(700):
        client.state(i, f"state {i}")
        log.add("test", str(i))
    documents.put("x", 2)
    first, second = client.take(), client.take()
    assert first[0] == to_json({"t": "doc", "name": "x", "value": 2}) and first[-1] == "state 699"
    seen = [event["seq"] for text in (first[1], second[0]) for event in json.loads(text)["events"]]
    assert seen == list(range(1, 701))
    assert client.states_dropped == 699


def test_states_on_the_way_are_limited_by_the_window():
    """States in the network's buffers become old, so the next state is sent after an acknowledgement."""
    log, documents = EventLog(time.time), Documents()
    client = Client("a", 0, documents, log)
    sent = []
    for i in range(20):
        client.state(i, str(i))
        log.add("test", str(i))
        sent += [text for text in client.take() if not text.startswith("{")]
    assert sent == [str(i) for i in range(WINDOW)] and client.behind()
    assert not client.seen(7) and not client.seen(True) and not client.seen("1") and not client.seen(-1)
    assert client.seen(1) and not client.seen(1)
    late = client.take()
    assert late[-1] == "19" and json.loads(late[0])["events"][0]["seq"] == WINDOW + 1  # the newest state, every event
    assert client.take() == []


def test_numbers_that_are_not_finite_become_null():
    assert to_json({"a": [float("nan"), 1.5], "b": float("inf")}) == '{"a":[null,1.5],"b":null}'


def test_reconnect_loses_no_event(tmp_path):
    async def read(ws, until):
        seen = []
        while not seen or seen[-1] < until:
            message = await ws.receive_json(timeout=60.0)
            if message["t"] == "events":
                assert message["lost"] == 0
                seen += [event["seq"] for event in message["events"]]
        return seen

    async def test():
        async with running(tmp_path) as console, console.browser() as client:
            seen = []
            for part in range(4):
                for i in range(50):
                    console.events.add("test", f"{part} {i}")
                async with console.socket_of(client) as ws:
                    await ws.send_json({"seq": seen[-1] if seen else 0, "epoch": "run1" if part else ""})
                    assert (await ws.receive_json())["epoch"] == "run1"
                    for i in range(50):
                        console.events.add("test", f"{part} {i}")
                    seen += await read(ws, console.events.newest())
            assert seen == list(range(1, console.events.newest() + 1))

    asyncio.run(test())


def deaf_browser(console, key):
    """A WebSocket with a small buffer that never reads after its handshake."""
    deaf = socket.socket()
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    deaf.connect(("127.0.0.1", console.port))
    lines = [
        "GET /ws HTTP/1.1",
        f"Host: {console.host}",
        f"Origin: {console.origin}",
        f"Cookie: c={key}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "",
        "",
    ]
    deaf.sendall("\r\n".join(lines).encode() + bytes([0x81, 0x82, 0, 0, 0, 0]) + b"{}")
    return deaf


def test_a_browser_that_never_reads_slows_nobody_and_is_cut_off(tmp_path):
    async def test():
        async with running(tmp_path) as console, console.browser() as other, console.socket_of(other) as good:
            deaf = deaf_browser(console, console.access.redeem(console.access.new_token()).key)
            await good.send_str("{}")
            while len(console.server.clients) < 2:
                await asyncio.sleep(0.02)
            text, got = "x" * 20000, 0
            began = time.monotonic()
            while time.monotonic() - began < 120.0 and len(console.server.clients) == 2:
                console.server.publish_state({"text": text})
                while (message := await good.receive_json(timeout=60.0))["t"] != "state":
                    pass
                await good.send_json({"t": "seen", "n": message["n"]})
                got += any(client.behind() for client in console.server.clients)
                await asyncio.sleep(0.005)
            assert got > 10  # states that came while the deaf one took nothing more
            assert [client.name for client in console.server.clients] == ["browser 1"]  # the deaf one was cut off
            deaf.close()

    asyncio.run(test())
