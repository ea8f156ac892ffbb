"""From another computer through ssh -L: the documented way is served, and another port where it was named."""

import asyncio
import socket

import aiohttp
from aiohttp.abc import AbstractResolver
from console_double import running
from forwarder import Forwarder


def go(test, tmp_path, **more):
    async def inside():
        async with running(tmp_path, **more) as console:
            await asyncio.wait_for(test(console), 30)

    asyncio.run(inside())


class OtherLoopback(AbstractResolver):
    """Every name is ::1, where a tunnel may have the port that the console has on 127.0.0.1."""

    async def resolve(self, host, port=0, family=socket.AF_INET6):
        return [{"hostname": host, "host": "::1", "port": port, "family": socket.AF_INET6, "proto": 0, "flags": 0}]

    async def close(self):
        pass


async def through(console, port, name, resolver=None):
    """Statuses of a browser behind a tunnel that begins at this port: the link, a command, the WebSocket."""
    origin = f"http://{name}:{port}"
    link = console.link().replace(console.url, origin)
    statuses = []
    connector, jar = aiohttp.TCPConnector(resolver=resolver), aiohttp.CookieJar(unsafe=True)
    async with aiohttp.ClientSession(connector=connector, cookie_jar=jar) as client:
        async with client.get(link, allow_redirects=False) as response:
            statuses.append(response.status)
            words = await response.text()
        headers = {**console.headers, "Origin": origin}
        body = {"name": "note", "arguments": {"text": "x"}}
        async with client.post(f"{origin}/api/command", json=body, headers=headers) as response:
            statuses.append(response.status)
        try:
            async with client.ws_connect(f"ws://{name}:{port}/ws", headers={"Origin": origin}) as ws:
                await ws.send_str("{}")
                statuses.append((await ws.receive_json())["t"])
        except aiohttp.WSServerHandshakeError as error:
            statuses.append(error.status)
    return statuses, words


def test_a_tunnel_as_the_docs_have_it_is_served(tmp_path):
    """ssh -L 8790:127.0.0.1:8790: the port is the same at both ends, so that the names are those of loopback."""

    async def test(console):
        tunnel = Forwarder(console.port, console.port, socket.AF_INET6)  # the other end of loopback
        try:
            statuses, _ = await through(console, console.port, "localhost", OtherLoopback())
            assert statuses == [302, 200, "you"]
        finally:
            tunnel.close()

    go(test, tmp_path)


def test_a_tunnel_from_another_port_is_served_where_it_was_named(tmp_path):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]

    async def refused(console):
        tunnel = Forwarder(console.port, port)
        statuses, words = await through(console, port, "127.0.0.1")
        tunnel.close()
        assert statuses == [403, 403, 403]
        assert f"127.0.0.1:{port}" in words and f"127.0.0.1:{console.port}" in words

    async def served(console):
        tunnel = Forwarder(console.port, port)
        assert (await through(console, port, "127.0.0.1"))[0] == [302, 200, "you"]
        tunnel.close()

    go(refused, tmp_path)
    go(served, tmp_path, hosts=[f"127.0.0.1:{port}"])
