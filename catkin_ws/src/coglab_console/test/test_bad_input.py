"""Two operators at once, a STOP in the middle of a request, a browser that dies with a button held, requests that no
page would send: each refused or bounded, and said."""

import asyncio
import json
import socket

import aiohttp
import pytest
from coglab_console.desk.desk import DeskReply
from console_double import RobotDouble, served

RECEIVE = {"action": "exchange_human_to_robot"}


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A crowded computer makes gaps between the messages of a held button; gaps have tests of their own."""
    monkeypatch.setattr("coglab_console.desk.motion_guard.LONGEST_GAP", 5.0)


class SlowRobot(RobotDouble):
    """Answers a request when it is let; `asked` is set when one has come."""

    def __init__(self) -> None:
        super().__init__()
        self.asked, self.let = asyncio.Event(), asyncio.Event()

    async def call(self, name: str, arguments: dict) -> DeskReply:
        self.calls.append((name, arguments))
        self.asked.set()
        await self.let.wait()
        return DeskReply(True, "done")


def events_of(console, source):
    return [event["text"] for event in console.events.since(0)[0] if event["source"] == source]


async def until(condition, limit=60.0):
    end = asyncio.get_running_loop().time() + limit
    while not condition():
        assert asyncio.get_running_loop().time() < end, "not in time"
        await asyncio.sleep(0.02)


@served()
async def test_only_one_of_two_operators_is_served(console):
    async with console.browser() as one, console.browser() as two:
        async with console.socket_of(one) as first, console.socket_of(two) as second:
            for ws in (first, second):
                await ws.send_str("{}")
                await ws.receive()
            answers = await asyncio.gather(*(console.post(client, "home") for client in (one, two) for _ in range(5)))
            assert [status for status, _ in answers] == [200] * 5 + [409] * 5
            assert all("browser 1" in answer["message"] for _, answer in answers[5:])
            assert len(console.robot.calls) == 5
            # Both hold at once: the observer starts nothing and gets the reason.
            console.desk.guard.stop("a test")
            console.desk.guard.acknowledge(console.desk.guard.stops)
            frame = json.dumps({"t": "hold", "id": 7, "name": "start", "arguments": RECEIVE})
            for _ in range(11):
                await first.send_str(frame)
                await second.send_str(frame)
                await asyncio.sleep(0.1)
            while (message := await second.receive_json(timeout=60.0))["t"] != "answer":
                pass
            assert not message["success"] and "browser 1" in message["message"]
            await until(lambda: len(console.robot.calls) == 6)


@served(SlowRobot)
async def test_a_stop_during_a_request_still_asks_for_both_acts(console):
    """A STOP while the machine has not answered a start yet: the answer, which comes later, is not the first motion."""
    robot = console.robot
    async with console.browser() as client, console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.receive()
        started = asyncio.create_task(console.post(client, "start", RECEIVE))
        await robot.asked.wait()
        assert (await console.post(client, "stop"))[0] == 200
        robot.let.set()
        assert (await started)[0] == 200
        assert "acknowledge" in (await console.post(client, "home"))[1]["message"]
        await console.post(client, "acknowledge", {"stop": console.desk.guard.stops})
        status, answer = await console.post(client, "home")
        assert status == 409 and "hold" in answer["message"]
        assert len(robot.calls) == 1


@served()
async def test_a_browser_that_dies_with_a_button_held_is_told_to_the_others(console, client, monkeypatch):
    # it dies before, however slow this computer is
    monkeypatch.setattr("coglab_console.desk.motion_guard.HOLD_TIME", 3600.0)
    ws = await console.socket_of(client)
    await ws.send_str("{}")
    console.desk.guard.stop("a test")
    console.desk.guard.acknowledge(console.desk.guard.stops)
    for _ in range(4):
        await ws.send_str(json.dumps({"t": "hold", "name": "start", "arguments": RECEIVE}))
        await asyncio.sleep(0.1)
    ws.get_extra_info("socket").shutdown(socket.SHUT_RDWR)
    await until(lambda: events_of(console, "command"))
    (told,) = events_of(console, "command")
    assert "browser 1" in told and "Receive" in told
    assert not console.robot.calls


@served()
async def test_only_a_held_button_is_reported_when_the_browser_leaves(console, client, monkeypatch):
    for release in (True, False):
        monkeypatch.setattr("coglab_console.desk.motion_guard.HOLD_TIME", 3600.0 if release else 0.8)
        ws = await console.socket_of(client)
        await ws.send_str("{}")
        console.desk.guard.stop("a test")
        console.desk.guard.acknowledge(console.desk.guard.stops)
        for _ in range(3 if release else 11):
            await ws.send_str(json.dumps({"t": "hold", "name": "start", "arguments": RECEIVE}))
            await asyncio.sleep(0.1)
        if release:
            await ws.send_str('{"t": "release"}')
        await ws.close()
        await until(lambda: not console.server.clients)
    assert not [text for text in events_of(console, "command") if "while holding" in text]
    assert len(console.robot.calls) == 1


@pytest.mark.parametrize("method", ["PUT", "OPTIONS"])
@pytest.mark.parametrize("address", ["/api/command", "/"])
@served()
async def test_other_methods_are_refused_and_grant_no_other_origin(console, method, address):
    headers = {"Origin": "https://evil.example", "Access-Control-Request-Method": "POST"}
    async with console.browser() as client:
        async with client.request(method, console.url + address, headers=headers) as response:
            assert response.status == 405
            assert not [name for name in response.headers if name.lower().startswith("access-control")]


@served()
async def test_what_is_too_long_is_refused_with_the_limit(console, client):
    address, body = console.url + "/api/command", b" " * 70000
    async with client.post(address, data=body, headers=console.headers) as response:
        assert response.status == 413 and "65536 bytes" in (await response.json())["message"]


@served()
async def test_object_files_are_not_read_again_under_way(console, client):
    """They hold thresholds of the contact detector, too."""
    async with console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.receive()
        status, answer = await console.post(client, "objects_reload")
        assert status == 409 and "hold" in answer["message"]
        console.desk.experiment.begin("P1", ["a"], 1, "as_listed", 0)
        console.desk.experiment.trial_begin()
        status, answer = await console.post(client, "objects_reload")
        assert status == 409 and "under way" in answer["message"]


@served()
async def test_a_client_that_sends_half_a_request_holds_nobody_up(console):
    halves = []
    for _ in range(20):
        _, writer = await asyncio.open_connection("127.0.0.1", console.port)
        writer.write(b"POST /api/stop HTTP/1.1\r\nHost: ")
        halves.append(writer)
    async with console.browser() as client, aiohttp.ClientSession():
        assert (await console.post(client, "note", {"text": "x"}))[0] == 200
    for writer in halves:
        writer.close()


SESSION = {"participant": "P07", "conditions": ["a", "b"], "repetitions": 1, "order": "latin_square"}


@pytest.mark.parametrize(
    "name, arguments, where",
    [
        ("session_begin", {**SESSION, "participant": "P07\n"}, "participant"),
        ("session_begin", {**SESSION, "conditions": ["a\n"]}, "conditions"),
        ("session_begin", {**SESSION, "repetitions": 2.0}, "repetitions"),
        ("session_begin", {**SESSION, "number": 7.0}, "number"),
        ("contact_arm", {"mode": "contact", "joints": [1.0]}, "joints"),
        ("select_object", {"object_id": "mug\n"}, "object_id"),
        ("feedback", {"verb": "pause", "name": "yield\n"}, "name"),
        ("note", {"text": "half a character: \ud800"}, "text"),
    ],
)
@served()
async def test_what_nearly_fits_is_refused_and_begins_nothing(console, client, tmp_path, name, arguments, where):
    """A line's end behind a name, a number that only looks whole, text that has no UTF-8."""
    async with console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.receive()
        status, answer = await console.post(client, name, arguments)
        assert status == 409 and where in answer["message"], (status, answer)
        assert not console.robot.calls and not console.robot.published and not list(tmp_path.iterdir())


@pytest.mark.parametrize("body", ['{"name": "note", "arguments": {"text": %s}}', '{"name": %s}', "%s"])
@served()
async def test_whatever_the_depth_of_a_request_it_is_refused_in_words(console, client, body):
    for depth in range(900, 1000):
        text = body % ("[" * depth + "]" * depth)
        async with client.post(f"{console.url}/api/command", data=text, headers=console.headers) as answer:
            assert answer.status in (400, 409), (depth, answer.status, await answer.text())
            assert (await answer.json())["success"] is False
        await asyncio.sleep(0.03)  # within the request rate of one browser


@served()
async def test_what_the_console_cannot_do_is_answered_in_its_own_form_and_it_goes_on(console, client, monkeypatch):
    async with console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.receive()
        with monkeypatch.context() as broken:
            broken.setattr(console.robot, "publish", lambda *_: 1 / 0)
            status, answer = await console.post(client, "note", {"text": "x"})
        assert status == 500 and not answer["success"] and "ZeroDivisionError" in answer["message"]
        assert (await console.post(client, "note", {"text": "x"}))[0] == 200
