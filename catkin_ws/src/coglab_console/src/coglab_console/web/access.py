"""Access to the console: one-time tokens, sessions, and the lists of hosts and origins. Needs no web library.

A browser opens the printed link with a token (/?t=TOKEN) once and gets a session, stored in its cookie.
Every request must name a host of the list (against DNS rebinding). The WebSocket and requests that change something
must also come from an origin of the list. A POST must also have a header that a foreign page cannot set.

A program without a browser gets a key for a token (POST /api/session) and sends it as `Authorization: Bearer KEY`. No
page can make a browser send that, so neither origin nor header is required; an origin that is sent must be listed.
"""

from __future__ import annotations

import hmac
import secrets
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

CSRF_HEADER = "X-CogLab-Console"
MAX_SESSIONS = 32
SESSION_LIFE = 24 * 3600.0  # s without a request, after which a session ends


class Denied(Exception):
    """A refused request: HTTP status and a message."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class TokenBucket:
    """Limits requests to `rate` per second and `burst` at once; refuses more."""

    def __init__(self, rate: float, burst: float, now: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._burst, self._now = rate, burst, now
        self._level, self._since = burst, now()

    def take(self) -> bool:
        """True if one more request is allowed."""
        now = self._now()
        self._level = min(self._burst, self._level + (now - self._since) * self._rate)
        self._since = now
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


@dataclass
class Session:
    """One browser or program. Other browsers see its `name`."""

    key: str
    name: str
    seen: float
    requests: TokenBucket
    stops: TokenBucket
    sockets: int = 0
    program: bool = False
    """True if its key comes as Authorization: Bearer, never as a cookie."""


def allowed_hosts(address: str, port: int, more: Iterable[str] = ()) -> tuple[str, ...]:
    """Allowed values of the header Host: the address of the console, loopback (for a tunnel), and those in `more`."""
    names = {"127.0.0.1", "localhost"} | ({address} if address not in ("0.0.0.0", "::") else set())
    found = {f"{name}:{port}" for name in names} | {host if ":" in host else f"{host}:{port}" for host in more}
    return tuple(sorted(found))


class Access:
    """Tokens and sessions of one launch; both live in memory alone. Called from one thread."""

    def __init__(self, hosts: Iterable[str], now: Callable[[], float] = time.monotonic) -> None:
        self.hosts = frozenset(hosts)
        self.origins = frozenset(f"http://{host}" for host in self.hosts)
        self._now = now
        self._tokens: list[str] = []
        self._sessions: dict[str, Session] = {}
        self._count = 0
        self.refused = TokenBucket(200.0, 200.0, now)
        """Limit of requests without a session; further ones get status 429."""

    def new_token(self) -> str:
        """A new token for one session. At most eight unused tokens are valid; older ones expire."""
        token = secrets.token_urlsafe(24)
        self._tokens = [*self._tokens[-7:], token]
        return token

    def redeem(self, token: str, program: bool = False) -> Session | None:
        """The session for an unused token, else None."""
        given = token.encode(errors="replace")
        spent = next((known for known in self._tokens if hmac.compare_digest(known.encode(), given)), None)
        if spent is None:
            return None
        self._tokens.remove(spent)
        return self._new_session(program)

    def _new_session(self, program: bool) -> Session:
        now = self._now()
        for key in [key for key, one in self._sessions.items() if now - one.seen > SESSION_LIFE and not one.sockets]:
            del self._sessions[key]
        if len(self._sessions) >= MAX_SESSIONS:
            idle = [one for one in self._sessions.values() if not one.sockets]
            if not idle:
                raise Denied(503, f"{MAX_SESSIONS} browsers are connected; close one of them, then request a new link")
            del self._sessions[min(idle, key=lambda one: one.seen).key]
        self._count += 1
        limits = TokenBucket(40.0, 120.0, self._now), TokenBucket(50.0, 50.0, self._now)
        name = f"{'program' if program else 'browser'} {self._count}"
        session = Session(secrets.token_urlsafe(24), name, now, *limits, program=program)
        self._sessions[session.key] = session
        return session

    def sessions(self) -> list[Session]:
        """All sessions."""
        return list(self._sessions.values())

    def check_host(self, headers: Mapping[str, str]) -> None:
        """Checks the header Host of every request. Raises Denied."""
        host = headers.get("Host", "")
        if host not in self.hosts:
            raise Denied(403, f"host '{host[:80]}' is not served; this console serves {', '.join(sorted(self.hosts))}")

    def check_origin(self, headers: Mapping[str, str]) -> None:
        """Checks the origin of a WebSocket or of a request that changes something. Raises Denied."""
        origin = headers.get("Origin")
        if origin not in self.origins:
            came = f"'{origin[:80]}'" if origin else "none"
            raise Denied(403, f"origin {came} is not allowed here; expected the console's own page")

    def check_csrf(self, headers: Mapping[str, str]) -> None:
        """Checks the header that every POST of a browser needs. Raises Denied."""
        if headers.get(CSRF_HEADER) != "1":
            raise Denied(403, f"the header {CSRF_HEADER}: 1 is missing; only the console's own page sends it")

    @staticmethod
    def bearer_of(headers: Mapping[str, str]) -> str | None:
        """The Bearer key of a program; None for a browser, which sends none."""
        words = headers.get("Authorization")
        if words is None:
            return None
        scheme, _, key = words.partition(" ")
        if scheme.lower() != "bearer" or not key.strip():
            raise Denied(401, "expected the header Authorization: Bearer KEY; a key comes from POST /api/session")
        return key.strip()[:100]

    def session_of(self, key: str | None, program: bool = False) -> Session:
        """The session of a cookie, or of a program's key. Raises Denied."""
        session = self._sessions.get(key or "")
        if session is None or session.program != program:
            if program:
                raise Denied(401, "no session for this Bearer key; a key comes from POST /api/session with a new token")
            raise Denied(401, "no session: open the link that the terminal printed; a new one is in console.url")
        session.seen = self._now()
        return session
