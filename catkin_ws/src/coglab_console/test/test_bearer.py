"""Programs without a browser: a key for a one-time token, sent as Authorization: Bearer, and refused requests."""

import asyncio

import aiohttp
import pytest
from coglab_console.web.access import TokenBucket
from console_double import served

NOTE = {"name": "note", "arguments": {"text": "by a program"}}


def bearer(key, **more):
    return {"Authorization": f"Bearer {key}", **more}


async def posted(console, client, address, headers, body=None):
    async with client.post(console.url + address, json=body, headers=headers) as response:
        return response.status, await response.json()


async def key_for(console, client):
    status, answer = await posted(console, client, "/api/session", bearer(console.access.new_token()))
    assert status == 200
    return answer["data"]


@served(program=True)
async def test_a_program_asks_with_a_key_and_neither_origin_nor_header(console, client):
    key = await key_for(console, client)
    assert (await posted(console, client, "/api/command", bearer(key), NOTE))[0] == 200
    assert (await posted(console, client, "/api/stop", bearer(key)))[0] == 200
    assert console.robot.stops == ["program 1"] and console.robot.published == [("note", "by a program")]
    async with client.ws_connect(f"ws://{console.host}/ws", headers=bearer(key)) as ws:
        await ws.send_str("{}")
        assert (await ws.receive_json())["name"] == "program 1"


@served(program=True)
async def test_a_token_makes_one_key_or_one_session_and_not_both(console, client):
    token = console.access.new_token()
    assert (await posted(console, client, "/api/session", bearer(token)))[0] == 200
    status, answer = await posted(console, client, "/api/session", bearer(token))
    assert status == 401 and "console.url" in answer["message"]
    async with client.get(f"{console.url}/?t={token}", allow_redirects=False) as response:
        assert response.status == 401
    # The token itself is no key, and neither is it after it was used.
    assert (await posted(console, client, "/api/stop", bearer(token)))[0] == 401
    assert (await posted(console, client, "/api/stop", bearer(console.access.new_token())))[0] == 401
    assert not console.robot.stops


@served(program=True)
async def test_a_key_is_no_cookie_and_a_cookie_no_key(console, client):
    key = await key_for(console, client)
    cookie = console.access.redeem(console.access.new_token()).key
    assert (await posted(console, client, "/api/stop", bearer(cookie)))[0] == 401
    headers = {**console.headers, "Cookie": f"c={key}"}
    assert (await posted(console, client, "/api/stop", headers))[0] == 401
    assert not console.robot.stops


@pytest.mark.parametrize("value", ["", "Bearer", "Bearer ", "Basic {key}", "Bearer {key}x", "Bearer é", "{key}"])
@served(program=True)
async def test_what_is_no_key_is_refused(console, client, value):
    """Also where a cookie would do: who sends the header means it."""
    key = await key_for(console, client)
    cookie = console.access.redeem(console.access.new_token()).key
    headers = {**console.headers, "Cookie": f"c={cookie}", "Authorization": value.format(key=key)}
    status, answer = await posted(console, client, "/api/stop", headers)
    assert status == 401 and "Bearer" in answer["message"]
    assert not console.robot.stops


@pytest.mark.parametrize("origin", ["https://evil.example", "null", ""])
@served(program=True)
async def test_a_key_from_a_foreign_page_is_refused(console, client, origin):
    key = await key_for(console, client)
    for address in ("/api/command", "/api/stop"):
        assert (await posted(console, client, address, bearer(key, Origin=origin), NOTE))[0] == 403
    token = console.access.new_token()
    assert (await posted(console, client, "/api/session", bearer(token, Origin=origin)))[0] == 403
    assert console.access.redeem(token) is not None  # it was not spent
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        await client.ws_connect(f"ws://{console.host}/ws", headers=bearer(key, Origin=origin))
    assert refused.value.status == 403 and not console.robot.stops


@served(program=True)
async def test_a_program_watches_until_it_takes_over_and_is_limited_like_a_browser(console, client):
    console.desk.connected("browser 9")
    key = await key_for(console, client)
    status, answer = await posted(console, client, "/api/command", bearer(key), {"name": "home"})
    assert status == 409 and "browser 9" in answer["message"]
    for session in console.access.sessions():
        session.requests = TokenBucket(1.0, 5.0)
    statuses = [(await posted(console, client, "/api/command", bearer(key), NOTE))[0] for _ in range(30)]
    assert 429 in statuses and (await posted(console, client, "/api/stop", bearer(key)))[0] == 200


@served(program=True)
async def test_guesses_are_bounded(console, client):
    console.access.refused = TokenBucket(1.0, 10.0)
    for address in ("/api/session", "/api/stop"):
        statuses = [(await posted(console, client, address, bearer("x" * 32)))[0] for _ in range(30)]
        assert set(statuses) <= {401, 429} and 429 in statuses


@served()
async def test_bytes_that_are_no_text_are_no_token(console):
    for bytes_sent in (b"\xff\xfe", b"x" * 300, b"\xc3\xa9"):
        reader, writer = await asyncio.open_connection("127.0.0.1", console.port)
        head = f"POST /api/session HTTP/1.1\r\nHost: {console.host}\r\nConnection: close\r\nAuthorization: Bearer "
        writer.write(head.encode() + bytes_sent + b"\r\n\r\n")
        assert b" 401 " in (await reader.read()).split(b"\r\n")[0]
        writer.close()
