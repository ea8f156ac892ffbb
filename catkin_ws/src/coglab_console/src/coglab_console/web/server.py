"""The web server: aiohttp routes around Access, Desk and the browsers' connections.

GET  /?t=TOKEN   a session for a one-time token      GET /ws      state, events, documents; STOP and held buttons
GET  / /page /lib  the page                          POST /api/command {"name", "arguments"}      POST /api/stop
POST /api/session  gives a program a key for a one-time token; the program sends it as Authorization: Bearer
"""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from aiohttp import WSMessage, WSMsgType, web

from ..desk.desk import Desk, DeskReply
from ..desk.events import EventLog
from .access import Access, Denied, Session
from .fan_out import Client, Documents, to_json
from .page_files import PageFile

MAX_MESSAGE = 64 * 1024  # bytes of a request's body or of a frame
MAX_BAD_FRAMES = 20
MAX_SOCKETS = 4  # per browser
SEND_LIMIT = 5.0  # s that a browser may take to read
HELLO_LIMIT = 3.0  # s within which a new connection must send its newest event number
CSP = (
    "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self' ws://{host}; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
REFUSALS = {  # by HTTP status, instead of the library's short text
    405: "expected GET for the page, POST for /api/command, /api/stop and /api/session",
    413: f"expected at most {MAX_MESSAGE} bytes; a command is far shorter",
}
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}

_LOG = logging.getLogger(__name__)


def parsed(text: str) -> Any:
    """Parses JSON of a browser. Raises ValueError also for NaN and Infinity, which Python accepts."""

    def refuse(word: str) -> object:
        raise ValueError(f"{word} is no number")

    return json.loads(text, parse_constant=refuse)


class ConsoleServer:
    """The web server of one console. By `epoch`, a browser that reconnects sees whether it is the same run."""

    def __init__(
        self,
        access: Access,
        desk: Desk,
        events: EventLog,
        documents: Documents,
        files: dict[str, PageFile],
        cookie: str,
        epoch: str,
        spent: Callable[[], object] = lambda: None,
    ) -> None:
        self.access, self.desk, self.events, self.documents = access, desk, events, documents
        self._files, self._cookie, self._epoch, self._spent = files, cookie, epoch, spent
        self.clients: set[Client] = set()
        self._number = 0  # of the newest state
        documents.changed = self.wake
        self.app = web.Application(client_max_size=MAX_MESSAGE, middlewares=[self._guard])
        self.app.router.add_get("/ws", self._socket)
        self.app.router.add_post("/api/command", self._command)
        self.app.router.add_post("/api/stop", self._stop)
        self.app.router.add_post("/api/session", self._key)
        self.app.router.add_get("/{rest:.*}", self._file)
        self._tasks: set[asyncio.Task] = set()

    # --- to the browsers --------------------------------------------------------------------------------------

    def wake(self) -> None:
        """New events or documents: call from the event loop."""
        for client in self.clients:
            client.wake()

    def publish_state(self, state: dict) -> None:
        """Sends the newest state to every browser, with number `n` and time `at` (ms, the console's steady clock)."""
        if self.clients:
            self._number += 1
            now = round(1000 * asyncio.get_running_loop().time())
            text = to_json({"t": "state", "n": self._number, "at": now, **state})
            for client in self.clients:
                client.state(self._number, text)

    # --- requests ---------------------------------------------------------------------------------------------

    @web.middleware
    async def _guard(self, request: web.Request, handler: Callable[[web.Request], Awaitable]) -> web.StreamResponse:
        try:
            self.access.check_host(request.headers)
            response = await handler(request)
        except Denied as error:
            response = web.json_response(DeskReply(False, str(error)), status=error.status)
        except web.HTTPException as error:
            words = REFUSALS.get(error.status, error.reason)
            response = web.json_response(DeskReply(False, words), status=error.status)
        except Exception as error:
            # A connection that became a WebSocket accepts no HTTP response.
            if isinstance(error, ConnectionError) or request.path == "/ws":
                raise
            _LOG.exception("%s %s", request.method, request.path)
            words = f"internal error of the console ({type(error).__name__}); see its log"
            response = web.json_response(DeskReply(False, words), status=500)
        if not response.prepared:
            response.headers.update(HEADERS)
            host = request.headers.get("Host", "")
            response.headers["Content-Security-Policy"] = CSP.format(
                host=host if host in self.access.hosts else "'none'"
            )
        return response

    def _session(self, request: web.Request) -> Session:
        try:
            key = self.access.bearer_of(request.headers)
            cookie = request.cookies.get(self._cookie)
            session = self.access.session_of(cookie) if key is None else self.access.session_of(key, program=True)
        except Denied:
            if not self.access.refused.take():
                raise Denied(429, "too many requests without a session") from None
            raise
        return session

    @staticmethod
    def _limited(session: Session) -> None:
        if not session.requests.take():
            raise Denied(429, "too many requests; wait a second")

    async def _file(self, request: web.Request) -> web.StreamResponse:
        token = request.query.get("t")
        if request.path == "/" and token is not None:
            return self._redeem(token)
        session = self._session(request)
        self._limited(session)
        file = self._files.get(request.path)
        if file is None:
            raise Denied(404, "no such file; a missing library is named in the event log")
        headers = {"ETag": f'"{file.tag}"', "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if request.headers.get("If-None-Match") == f'"{file.tag}"':
            return web.Response(status=304, headers=headers)
        packed = "gzip" in request.headers.get("Accept-Encoding", "")
        if packed:
            headers["Content-Encoding"] = "gzip"
        body = file.packed if packed else file.plain
        return web.Response(body=body, content_type=file.kind, charset="utf-8", headers=headers)

    def _spend(self, token: str, program: bool = False) -> Session:
        """The session for a one-time token."""
        if not self.access.refused.take():
            raise Denied(429, "too many requests without a session")
        session = self.access.redeem(token[:100], program)
        if session is None:
            raise Denied(401, "this link was used already, or is of another run; a new one is in console.url")
        self._spent()
        return session

    async def _key(self, request: web.Request) -> web.Response:
        self._from_here(request)
        session = self._spend(self.access.bearer_of(request.headers) or "", program=True)
        return web.json_response(DeskReply(True, f"the key of {session.name}, for as long as it is used", session.key))

    def _redeem(self, token: str) -> web.Response:
        session = self._spend(token)
        response = web.Response(status=302, headers={"Location": "/", "Cache-Control": "no-store"})
        response.set_cookie(self._cookie, session.key, httponly=True, samesite="Strict", path="/")
        return response

    def _changing(self, request: web.Request) -> Session:
        """The session of a request that changes something."""
        if not self._from_here(request):
            self.access.check_csrf(request.headers)
        return self._session(request)

    def _from_here(self, request: web.Request) -> bool:
        """Refuses requests of a foreign page. Returns True for a program, which need not send an origin."""
        program = "Authorization" in request.headers
        if not program or "Origin" in request.headers:
            self.access.check_origin(request.headers)
        return program

    async def _command(self, request: web.Request) -> web.Response:
        session = self._changing(request)
        self._limited(session)
        try:
            body = parsed(await request.text())
            name, arguments = body["name"], body.get("arguments", {})
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise Denied(400, 'expected {"name": ..., "arguments": {...}} in JSON') from None
        answer = await self.desk.command(session.name, name, arguments)
        return web.json_response(answer, status=200 if answer["success"] else 409, dumps=to_json)

    async def _stop(self, request: web.Request) -> web.Response:
        session = self._changing(request)
        return web.json_response(self._press(session))

    def _press(self, session: Session) -> DeskReply:
        if not session.stops.take():  # no person presses so often; an earlier STOP was sent
            return DeskReply(True, "STOP was sent a moment ago")
        return self.desk.stop(session.name)

    # --- one connection ---------------------------------------------------------------------------------------

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        self._from_here(request)
        session = self._session(request)
        self._limited(session)
        if session.sockets >= MAX_SOCKETS:
            raise Denied(429, f"this browser has {MAX_SOCKETS} connections already; close a tab")
        socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE, heartbeat=4.0, compress=False)
        await socket.prepare(request)
        session.sockets += 1
        if session.sockets == 1:
            self.desk.connected(session.name)
        sender = None
        try:
            seq = await self._hello(socket)
            client = Client(session.name, seq, self.documents, self.events)
            await socket.send_str(to_json({"t": "you", "name": session.name, "epoch": self._epoch}))
            sender = asyncio.create_task(self._serve(client, socket))
            await self._listen(socket, session, client)
        finally:
            if sender is not None:
                sender.cancel()
                await asyncio.gather(sender, return_exceptions=True)
            session.sockets -= 1
            self.desk.released(session.name, lost=True)
            if not session.sockets:
                self.desk.disconnected(session.name)
        return socket

    async def _hello(self, socket: web.WebSocketResponse) -> int:
        """Number of the newest event that the browser has; 0 if it sends none or an invalid one."""
        try:
            message = await socket.receive(timeout=HELLO_LIMIT)
            hello = parsed(message.data) if message.type is WSMsgType.TEXT else {}
            seq = hello.get("seq", 0) if hello.get("epoch") == self._epoch else 0
            return seq if isinstance(seq, int) and not isinstance(seq, bool) else 0
        except (TimeoutError, ValueError, AttributeError, RecursionError):
            return 0

    async def _serve(self, client: Client, socket: web.WebSocketResponse) -> None:
        self.clients.add(client)
        try:
            await client.serve(socket.send_str, SEND_LIMIT)
        except (TimeoutError, ConnectionError, RuntimeError):
            pass
        finally:
            self.clients.discard(client)
            transport = socket._req.transport if socket._req is not None else None
            if transport is not None and not socket.closed:
                transport.abort()  # the browser does not read, so a closing handshake would hang, too

    async def _listen(self, socket: web.WebSocketResponse, session: Session, client: Client) -> None:
        bad = 0
        async for message in socket:
            error = self._frame(message, session, client, socket)
            if error:
                bad += 1
                if bad > MAX_BAD_FRAMES:
                    await socket.close(code=1008, message=b"too many frames that mean nothing")
                    return
                await asyncio.wait_for(socket.send_str(to_json({"t": "refused", "message": error})), SEND_LIMIT)

    def _frame(self, message: WSMessage, session: Session, client: Client, socket: web.WebSocketResponse) -> str:
        """Processes one frame of the browser. Returns an error text, or an empty string."""
        try:
            if message.type is not WSMsgType.TEXT:
                raise ValueError("expected text")
            frame = parsed(message.data)
            kind = frame["t"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            return f"a frame was not understood: {str(error)[:100]}"
        if kind == "stop":
            self._press(session)
            self._reply(socket, DeskReply(True, "STOP was sent"), frame.get("id"))
        elif kind == "seen" and client.seen(frame.get("n")):
            pass
        elif not session.requests.take():
            return "too many frames; wait a second"
        elif kind == "seen":
            pass  # acknowledged before, or a state of another connection
        elif kind == "hold":
            task = asyncio.create_task(self._hold(frame, session, socket))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        elif kind == "release":
            self.desk.released(session.name)
        else:
            return f"a frame of kind '{str(kind)[:20]}' is unknown; there are: seen, stop, hold, release"
        return ""

    async def _hold(self, frame: dict, session: Session, socket: web.WebSocketResponse) -> None:
        answer = await self.desk.held(session.name, frame.get("name"), frame.get("arguments", {}))
        if answer is not None:
            self._reply(socket, answer, frame.get("id"))

    def _reply(self, socket: web.WebSocketResponse, answer: DeskReply, number: object) -> None:
        async def send() -> None:
            try:
                text = to_json({"t": "answer", "id": number if isinstance(number, int) else None, **answer})
                await asyncio.wait_for(socket.send_str(text), SEND_LIMIT)
            except (TimeoutError, ConnectionError, RuntimeError):
                pass

        task = asyncio.create_task(send())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
