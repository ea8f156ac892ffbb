"""Each row of the security table, and the limits: forbidden requests are refused with a message and reach no robot."""

import asyncio
import json
import time
from pathlib import Path

import aiohttp
import pytest
from coglab_console.web.access import CSRF_HEADER, TokenBucket
from console_double import served


@served()
async def test_the_console_page_may_ask(console, client):
    async with console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.receive()
        status, answer = await console.post(client, "home")
        assert (status, answer["success"]) == (200, True)
        assert console.robot.calls == [("home", {})]


@pytest.mark.parametrize("origin", ["null", "http://127.0.0.1", "https://{host}", "http://{host}.evil.example"])
@served()
async def test_a_foreign_origin_is_refused(console, origin):
    foreign = origin.format(host=console.host)
    async with console.browser() as client:
        for address in ("/api/command", "/api/stop"):
            headers = {**console.headers, "Origin": foreign}
            async with client.post(console.url + address, json={"name": "home"}, headers=headers) as response:
                assert response.status == 403
                assert "origin" in (await response.json())["message"]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await console.socket_of(client, Origin=foreign)
        assert refused.value.status == 403
    assert not console.robot.calls and not console.robot.stops


@pytest.mark.parametrize("left_out", ["Origin", CSRF_HEADER])
@served()
async def test_a_request_without_origin_or_header_is_refused(console, left_out):
    headers = {name: value for name, value in console.headers.items() if name != left_out}
    async with console.browser() as client:
        for address in ("/api/command", "/api/stop"):
            async with client.post(console.url + address, json={"name": "home"}, headers=headers) as response:
                assert response.status == 403
    assert not console.robot.calls and not console.robot.stops


@served()
async def test_a_websocket_without_origin_is_refused(console, client):
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        await client.ws_connect(f"ws://{console.host}/ws")
    assert refused.value.status == 403


@pytest.mark.parametrize("cookie", [None, "x" * 32])
@served()
async def test_without_a_session_nothing_is_served(console, cookie):
    async with aiohttp.ClientSession(cookies={"c": cookie} if cookie else None) as client:
        for address in ("/", "/page/main.js", "/lib/three/build/three.module.js", "/anything"):
            async with client.get(console.url + address) as response:
                assert response.status == 401
                assert "console.url" in (await response.json())["message"]
        status, _ = await console.post(client, "stop")
        assert status == 401
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await console.socket_of(client)
        assert refused.value.status == 401
    assert not console.robot.stops


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", ""])
@served()
async def test_a_foreign_host_is_refused(console, host):
    headers = {**console.headers, "Host": host.format(port=console.port)}
    async with console.browser() as client:
        for method, address in (("GET", "/"), ("POST", "/api/command"), ("GET", "/ws")):
            async with client.request(method, console.url + address, headers=headers) as response:
                assert response.status == 403


@served(hosts=["127.0.0.1:4711"])
async def test_requests_through_a_tunnel_are_served(console):
    """`ssh -L`: the browser sends the name and port of its own end of the tunnel."""
    for host in (f"localhost:{console.port}", "127.0.0.1:4711"):
        headers, origin = {**console.headers, "Host": host}, f"http://{host}"
        headers["Origin"] = origin
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as client:
            async with client.get(console.link(), headers=headers, allow_redirects=False) as response:
                assert response.status == 302
            status, _ = await console.post(client, "note", {"text": "x"}, Host=host, Origin=origin)
            assert status == 200
            async with console.socket_of(client, Host=host, Origin=origin) as ws:
                await ws.send_str("{}")
                assert (await ws.receive_json())["t"] == "you"


@served()
async def test_a_token_makes_one_session_once(console):
    link = console.link()
    async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as client:
        async with client.get(link, allow_redirects=False) as response:
            assert response.status == 302 and response.headers["Location"] == "/"
            cookie = response.headers["Set-Cookie"]
            assert "HttpOnly" in cookie and "SameSite=Strict" in cookie and "Path=/" in cookie
        for used in (link, f"{console.url}/?t=", f"{console.url}/?t={'a' * 5000}", f"{console.url}/?t=%ff%fe"):
            async with client.get(used, allow_redirects=False) as response:
                assert response.status == 401
                assert "Set-Cookie" not in response.headers


@served()
async def test_the_policy_forbids_inline_and_foreign_script(console):
    async with console.browser() as client:
        async with client.get(console.url) as response:
            policy = response.headers["Content-Security-Policy"]
            text = await response.text()
            assert response.headers["X-Content-Type-Options"] == "nosniff"
    for part in (
        "default-src 'self'",
        "script-src 'self'",
        "style-src 'self'",
        "frame-ancestors 'none'",
        "object-src 'none'",
    ):
        assert part in policy
    assert "unsafe" not in policy
    assert "onclick" not in text and "style=" not in text and "<script>" not in text


@pytest.mark.parametrize(
    "path",
    [
        "/page/../setup.py",
        "/page/%2e%2e/setup.py",
        "/lib/../../../../etc/passwd",
        "/page//main.js",
        "/..%2f..%2fetc/passwd",
        "/page/main.js%00",
        "/lib/three/package.json",
        "/page/",
    ],
)
@served()
async def test_only_listed_files_are_served(console, client, path):
    import yarl

    async with client.get(yarl.URL(console.url + path, encoded=True)) as response:
        assert response.status == 404


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b'{"name": "rm -rf"}',
        b'{"name": "home", "arguments": {"x": 1}}',
        b'{"name": "start", "arguments": {"action": "take", "object_id": "../x"}}',
        b"\xff\xfe",
        b"[" * 60000,
        b'{"name": "speed_scale", "arguments": {"value": NaN}}',
        b'{"name": "speed_scale", "arguments": {"value": 1e999}}',
        b'{"name": "call", "arguments": {"service": "/lwr/command"}}',
    ],
    ids=lambda body: body[:40].decode(errors="replace"),
)
@served()
async def test_what_is_not_in_the_list_or_fits_no_schema_is_refused(console, client, body):
    async with console.socket_of(client):
        headers = {**console.headers, "Content-Type": "application/json"}
        async with client.post(console.url + "/api/command", data=body, headers=headers) as response:
            assert response.status in (400, 409)
            assert (await response.json())["message"]
        assert not console.robot.calls
        status, _ = await console.post(client, "home")  # and the next one is served
        assert status == 200


@served()
async def test_malformed_frames_are_told_then_the_connection_closes(console):
    frames = [
        "{",
        "[]",
        "null",
        '{"t": 5}',
        '{"t": "call"}',
        "[" * 5000,
        '{"t": "hold"}',
        '{"t": "hold", "name": []}',
        "\x00",
    ]
    async with console.browser() as client, console.socket_of(client) as ws:
        await ws.send_str("{}")
        for frame in frames * 5:
            await ws.send_str(frame)
        kinds = []
        async for message in ws:
            kinds.append(json.loads(message.data)["t"])
        assert ws.close_code == 1008
        assert kinds.count("refused") == 20
    assert not console.robot.calls


@served()
async def test_binary_and_oversized_frames(console, client):
    async with console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.send_bytes(b"\x00\x01")
        while (message := await ws.receive_json())["t"] != "refused":
            pass
        assert "understood" in message["message"]
    async with console.socket_of(client) as ws:
        await ws.send_str("{}")
        await ws.send_str("x" * 70000)
        async for _ in ws:
            pass
        assert ws.close_code == 1009


@served()
async def test_a_thousand_requests_a_second_are_bounded_and_stop_goes_through(console):
    async with console.browser() as flooder, console.browser() as other, console.socket_of(other) as ws:
        await ws.send_str("{}")
        statuses, began = [], time.monotonic()
        for session in console.access.sessions():  # so few that a crowded computer floods it, too
            session.requests = TokenBucket(5.0, 20.0)

        async def flood():
            for _ in range(150):
                statuses.append((await console.post(flooder, "note", {"text": "x"}))[0])

        async def watch():
            await ws.send_str('{"t": "stop", "id": 1}')
            while (message := await ws.receive_json())["t"] != "answer":
                pass
            assert message["success"]

        floods = [asyncio.create_task(flood()) for _ in range(4)]
        await asyncio.sleep(0.3)
        await watch()
        await asyncio.gather(*floods)
        served = len(statuses) - statuses.count(429)
        assert served <= 20 + 5 * (time.monotonic() - began) + 1 < len(statuses)
        assert console.robot.stops == ["browser 2"]
        async with flooder.post(console.url + "/api/stop", headers=console.headers) as response:
            assert response.status == 200  # of the one that floods, too
        assert len(console.robot.stops) == 2


@served()
async def test_sessions_and_connections_are_bounded(console, client):
    sockets = [await console.socket_of(client) for _ in range(4)]
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        await console.socket_of(client)
    assert refused.value.status == 429
    for ws in sockets:
        await ws.close()
    for _ in range(60):
        console.access.redeem(console.access.new_token())
    assert len(console.access.sessions()) <= 32


@served(libraries=Path("/nowhere"))
async def test_missing_libraries_are_named_and_the_page_is_served(console):
    assert console.missing == ["libjs-dygraphs", "libjs-three"]
    async with console.browser() as client:
        async with client.get(console.url) as response:
            assert response.status == 200
        async with client.get(console.url + "/lib/dygraphs/dygraph.js") as response:
            assert response.status == 404
