"""Connections without a browser, for the bench: five that read, one that never does, one that asks without end."""

from __future__ import annotations

import asyncio
import json
import os
import time
from pathlib import Path

import aiohttp
from coglab_console.browser import fresh_link

SHOWN = 10.0  # s until a browser has its first state
WATCHED = 15.0  # s, with five browsers
FLOODED = 8.0  # s, with 1000 requests a second


def processor_time(process: int) -> float:
    """s of processor time that a process has used."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def watch_as(home: Path, used: set[str], shown: asyncio.Event, began: asyncio.Event) -> int:
    """One browser's connection that reads everything and sets `shown` with its first state; states received after
    `began`."""
    link = await unused_link(home, used)
    used.add(link)
    origin = link.split("/?")[0]
    count = 0
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as client:
        async with client.get(link):
            pass
        async with client.ws_connect(origin.replace("http", "ws") + "/ws", headers={"Origin": origin}) as ws:
            await ws.send_str("{}")
            while not began.is_set():
                if await take_one(ws):
                    shown.set()
            end = time.monotonic() + WATCHED
            while time.monotonic() < end:
                count += await take_one(ws)
    return count


async def take_one(ws: aiohttp.ClientWebSocketResponse) -> bool:
    """Reads one message as the page does: a state is told to have been seen. Whether it was one."""
    message = await ws.receive_str(timeout=5)
    if not message.startswith('{"t":"state"'):
        return False
    await ws.send_json({"t": "seen", "n": json.loads(message)["n"]})
    return True


async def load(home: Path, process: int) -> tuple[float, float]:
    """Share of a core that the node uses with five connections, and the slowest one's rate (Hz)."""
    used: set[str] = set()
    began = asyncio.Event()
    watchers = []
    for _ in range(5):
        shown = asyncio.Event()
        watchers.append(asyncio.create_task(watch_as(home, used, shown, began)))
        await asyncio.wait_for(shown.wait(), SHOWN)
    before, since = processor_time(process), time.monotonic()
    began.set()
    counts = await asyncio.gather(*watchers)
    return (processor_time(process) - before) / (time.monotonic() - since), min(counts) / WATCHED


def resident(process: int) -> float:
    """MB of memory that a process has."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Flood:
    """1000 notes a second by one browser over ten connections, as bytes: the bench's own work must not be the load."""

    def __init__(self, origin: str, cookie: dict[str, str]) -> None:
        self._host = origin.removeprefix("http://")
        body = b'{"name": "note", "arguments": {"text": "x"}}'
        (pair,) = cookie.items()
        self._request = (
            f"POST /api/command HTTP/1.1\r\nHost: {self._host}\r\nOrigin: {origin}\r\nX-CogLab-Console: 1\r\n"
            f"Cookie: {pair[0]}={pair[1]}\r\nContent-Length: {len(body)}\r\n\r\n"
        ).encode() + body
        self.sent = self.answered = self.taken = 0
        self.lasted = FLOODED

    async def _count(self, reader: asyncio.StreamReader) -> None:
        left = b""
        while data := await reader.read(65536):
            *whole, left = (left + data).split(b"HTTP/1.1 ")
            # Each piece but the first begins with a status; the newest may not be whole yet.
            for piece in whole:
                self._one(piece)
            if left[:3].isdigit() and len(left) > 3:
                self._one(left)
                left = left[-8:]  # the beginning of the next status line may be there

    def _one(self, piece: bytes) -> None:
        if piece[:3].isdigit():
            self.answered += 1
            self.taken += piece[:3] != b"429"

    async def run(self) -> None:
        """FLOODED s, and until everything was answered, 5 s at most."""
        host, port = self._host.split(":")
        ways = [await asyncio.open_connection(host, int(port)) for _ in range(10)]
        readers = [asyncio.create_task(self._count(reader)) for reader, _ in ways]
        began = due = time.monotonic()
        while time.monotonic() - began < FLOODED:
            for _, writer in ways:
                writer.write(2 * self._request)
            self.sent += 2 * len(ways)
            due += 0.02
            await asyncio.sleep(max(0.0, due - time.monotonic()))
        while self.answered < self.sent and time.monotonic() - began < FLOODED + 5.0:
            await asyncio.sleep(0.02)
        self.lasted = time.monotonic() - began
        for task, (_, writer) in zip(readers, ways, strict=True):
            task.cancel()
            writer.close()


async def flooded(home: Path) -> tuple[float, float, float, float]:
    """While one browser never reads and another asks 1000 times a second: (requests a second that were answered, those
    of them that were not refused, states a second to a good browser, longest STOP to its answer in s)."""
    used: set[str] = set()
    sessions = []
    for _ in range(3):
        link = await unused_link(home, used)
        used.add(link)
        sessions.append(await session_of(link))
    (deaf_cookie, origin), (flood_cookie, _), (good_cookie, _) = sessions
    address = origin.replace("http", "ws") + "/ws"
    headers = {"Origin": origin, "X-CogLab-Console": "1"}
    stops: list[float] = []
    states = 0
    flood = Flood(origin, flood_cookie)
    over = time.monotonic() + FLOODED
    async with (
        aiohttp.ClientSession(cookies=deaf_cookie) as deaf,
        aiohttp.ClientSession(cookies=good_cookie) as good,
        deaf.ws_connect(address, headers=headers) as silent,
        good.ws_connect(address, headers=headers) as ws,
    ):
        await silent.send_str("{}")
        await ws.send_str("{}")

        async def press() -> None:
            while time.monotonic() < over:
                began = time.monotonic()
                async with good.post(f"{origin}/api/stop", json={}, headers=headers) as answer:
                    await answer.read()
                stops.append(time.monotonic() - began)
                await asyncio.sleep(0.5)

        others = [asyncio.create_task(flood.run()), asyncio.create_task(press())]
        while time.monotonic() < over:
            states += await take_one(ws)
        await asyncio.gather(*others)
    return flood.answered / flood.lasted, flood.taken / flood.lasted, states / FLOODED, max(stops)


async def unused_link(home: Path, used: set[str]) -> str:
    """A link that was not used yet."""
    for _ in range(100):
        link = fresh_link(home, limit=5.0)
        if link not in used:
            return link
        await asyncio.sleep(0.05)
    raise TimeoutError("no new link in console.url within 5 s")


async def session_of(link: str) -> tuple[dict[str, str], str]:
    """The cookie of a session for this link, and the console's origin."""
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as client:
        async with client.get(link, allow_redirects=False) as answer:
            return {name: one.value for name, one in answer.cookies.items()}, link.split("/?")[0]
