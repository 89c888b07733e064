"""The only way into the ground station: who may come in, and what may pass.

viser listens on a random loopback port and asks nobody anything; whoever reached it could change the view. So the
browser talks to this gateway, which checks the Host header (a foreign name that resolves here is refused), the token
(good once, then a cookie of the browser's own) and the Origin of every WebSocket, bounds the size of a message and the
number of sockets, drops the messages that would publish the view on viser's share server, and passes the rest on.
Nobody holds a connection by silence: a request must come within `SILENCE_S`, a body must move every
`BODY_PAUSE_S`, and a WebSocket whose browser does not answer a ping is closed.

/          our page (`gcs_web/static`)
/ws        its WebSocket
/incoming/ takes the file of a flight log
/state     what the server holds, as JSON
/share     a trajectory as one HTML file, to keep or to pass on
/report    the newest report of a comparison or a diagnosis, likewise
/data      streams of a flight as CSV or Parquet
/viser/    the 3D view; /viser/of/NAME/ that of one page, by which the page has its camera moved
"""

import asyncio
import contextlib
import hashlib
import hmac
import logging
import mimetypes
import secrets
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from flight import FlightError, InputError
from gcs_web.gateway.entrants import Entrants

if TYPE_CHECKING:
    import ssl

    from aiohttp import ClientSession, web

logger = logging.getLogger(__name__)

LOOPBACK = "127.0.0.1"
_TABLES = ("csv", "text/csv; charset=utf-8"), ("parquet", "application/vnd.apache.parquet")
STATIC = Path(__file__).parents[1] / "static"
LARGEST_LOG = 1 << 30
"""Bytes of a flight log that is dropped on the page."""
LARGEST_MESSAGE = 1 << 20
"""Bytes that a browser may send at once."""
MOST_SOCKETS = 64
INVITATION_S = 120.0
"""An invitation is good once, and for so long."""
SILENCE_S = 30.0
"""Time for a request: a connection that is longer about it (line and header), or idle after one, is closed."""
PING_S = 20.0
"""Between two pings of a WebSocket; half of it is the time for an answer, then the socket is closed."""
BODY_PAUSE_S = 30.0
"""Longest pause inside a flight log or a table that is sent."""
_VIEW = "{view:[0-9a-f]{8,32}}"
"""Name of a page's 3D view, in routes."""
REFUSED_MESSAGES = frozenset({"ShareUrlRequest", "ShareUrlDisconnect"})
_HOP_HEADERS = frozenset({"connection", "transfer-encoding", "content-length", "content-encoding", "date", "server"})
_COMPRESSED = frozenset({"text/html", "text/css", "text/javascript", "application/javascript", "application/json"})
"""Types that are sent compressed to browsers that take it."""
_SAFETY_HEADERS = {
    "X-Frame-Options": "SAMEORIGIN",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}
_POLICY = (
    "default-src 'self'; connect-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "frame-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
_VIEW_POLICY = (  # viser's own page: inline script and style, data and blob addresses for textures and workers
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; connect-src 'self' data: blob:; "
    "worker-src 'self' blob:; frame-ancestors 'self'"
)
_VIEW_STYLE = (
    b"<style>.mantine-Paper-root,.mantine-Notifications-root{display:none!important}canvas[data-engine]{background:var(--scene)}"
    b"</style></head>"
)
"""Hides viser's own panel and messages: what they do is on our page, which sets the background to its own colour."""

Handler = Callable[["web.Request"], Awaitable["web.StreamResponse"]]
Serve = Callable[["web.WebSocketResponse", bool], Awaitable[None]]


class Gateway:
    """Serves `http://127.0.0.1:PORT/?token=...`, or https, in front of a viser server on another loopback port."""

    def __init__(
        self,
        upstream_port: int,
        *,
        serve_page: Serve,
        state: Callable[[], dict[str, Any]],
        incoming: Callable[[str], Path],
        share: Callable[[str], tuple[str, str]],
        report: Callable[[str], tuple[str, str]],
        data: Callable[[Mapping[str, str]], Iterable[bytes]],
        host: str = LOOPBACK,
        port: int = 0,
        tls: "ssl.SSLContext | None" = None,
        entrants: Entrants | None = None,
    ) -> None:
        """
        Args:
            serve_page: talks to one page over its WebSocket, told whether it is on the station's own machine.
            state: answers `/state`: what the server holds, as JSON.
            incoming: file for the flight log of a name that a page sends. Raises `InputError` to refuse it.
            share: answers `/share?name=...`: the name and the text of an HTML file. Raises `FlightError`.
            report: answers `/report?name=...` likewise.
            data: answers `/data?flight=...`, by what the address asks: a CSV in pieces. Raises `FlightError`.
            host: name or address to listen at, and the only name that is answered to beside this machine's own.
            port: 0 lets the system choose.
            tls: proves that it is `host`; then the page is https and its sockets are wss.
            entrants: who came in before, at this port; None: nobody.
        """
        self._incoming = incoming
        self._host, self._tls = host.lower(), tls  # lower, as browsers send it
        self._share, self._report, self._data = share, report, data
        self._upstream = f"{LOOPBACK}:{upstream_port}"
        self._serve_page, self._state, self._wanted_port = serve_page, state, port
        self._token = secrets.token_urlsafe(24)
        self._invitation, self._invited_s = "", 0.0
        self._entrants = entrants or Entrants()
        self._sockets, self._exporting = 0, asyncio.Lock()
        self._runner: web.AppRunner | None = None
        self._client: ClientSession | None = None
        self.port = 0
        self.refused = 0
        self.on_entry: Callable[[str], None] = lambda _: None
        """Somebody came in; called with the address for the next one."""
        self.on_invited: Callable[[], None] = lambda: None
        """An invitation was used up."""

    @property
    def url(self) -> str:
        """The address that lets one browser in; there is a new one after each."""
        return self._address(self._token)

    def invite(self) -> tuple[str, bool]:
        """An address that lets one more browser in, beside `url` and not for long; and whether it is a new one."""
        is_new = not self._is_invited(self._invitation)
        if is_new:
            self._invitation, self._invited_s = secrets.token_urlsafe(24), time.monotonic()
        return self._address(self._invitation), is_new

    def end_invitation(self) -> None:
        self._invitation = ""

    @property
    def invited_for_s(self) -> float:
        """How long the invitation is still good."""
        return max(self._invited_s + INVITATION_S - time.monotonic(), 0.0) if self._invitation else 0.0

    def _is_invited(self, token: str) -> bool:
        return self.invited_for_s > 0.0 and hmac.compare_digest(token.encode(), self._invitation.encode())

    def _address(self, token: str) -> str:
        return f"{self._scheme}://{self._host}:{self.port}/?token={token}"

    @property
    def _scheme(self) -> str:
        return "http" if self._tls is None else "https"

    async def start(self) -> None:
        """Listen. Raises `OSError` if the port is taken."""
        from aiohttp import ClientSession, ClientTimeout, web

        @web.middleware  # marks a function, and will not mark a method
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._guard(request, handler)

        application = web.Application(middlewares=[guard], client_max_size=LARGEST_MESSAGE)
        application.router.add_get("/", self._index)
        application.router.add_get("/static/{name:[a-z.]+}", self._file)
        application.router.add_get("/ws", self._page)
        application.router.add_get("/state", self._serve_state)
        application.router.add_put("/incoming/{name}", self._take_log)
        application.router.add_get("/share", self._serve_shared)
        application.router.add_get("/report", self._serve_report)
        application.router.add_get("/data", self._serve_data)
        application.router.add_get("/viser", self._pass_socket)  # viser's page leaves out the last slash here
        application.router.add_get(f"/viser/of/{_VIEW}", self._pass_socket)
        application.router.add_get(f"/viser/of/{_VIEW}/{{path:.*}}", self._pass_on)
        application.router.add_get("/viser/{path:.*}", self._pass_on)
        self._client = ClientSession(timeout=ClientTimeout(total=60), auto_decompress=False)
        self._runner = web.AppRunner(application, access_log=None, shutdown_timeout=1.0, keepalive_timeout=SILENCE_S)
        await self._runner.setup()
        site = web.TCPSite(self._runner, self._host, self._wanted_port, ssl_context=self._tls)
        await site.start()
        assert site._server is not None
        self.port = site._server.sockets[0].getsockname()[1]  # type: ignore[attr-defined]

    async def stop(self) -> None:
        if self._client is not None:
            await self._client.close()
        if self._runner is not None:
            await self._runner.cleanup()

    async def _guard(self, request: "web.Request", handler: "Handler") -> "web.StreamResponse":
        """Host, then token, then Origin; in this order, because each is cheaper to state than the next."""
        usual = 80 if self._tls is None else 443  # which browsers leave out
        names = {f"{name}:{self.port}" for name in (self._host, LOOPBACK, "localhost")}
        names |= {self._host, LOOPBACK, "localhost"} if self.port == usual else set()
        if request.host not in names:
            return self._refuse(f"this ground station answers to {self._host}:{self.port}, not to {request.host!r}")
        given = request.query.get("token")
        if given is not None:
            return self._enter(given)
        if not self._entrants.knows(request.cookies.get(self._cookie, "")):
            return self._refuse("a token is needed; open the address that `goshawk gcs` printed last")
        origin = request.headers.get("Origin")
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        if (origin is not None or is_socket) and origin not in {f"{self._scheme}://{name}" for name in names}:
            return self._refuse(f"a page from {origin!r} may not talk to this ground station")
        if is_socket and self._sockets >= MOST_SOCKETS:
            return self._refuse(f"{MOST_SOCKETS} connections are open; close a page", status=503)
        response = await handler(request)
        if not response.prepared:
            response.headers.update(_SAFETY_HEADERS)
            response.headers["Cache-Control"] = "private, no-cache" if "ETag" in response.headers else "no-store"
            is_text = response.content_type in _COMPRESSED and response.status != 304
            if is_text and "Content-Encoding" not in response.headers:
                response.enable_compression()
            of_view = request.path.startswith("/viser/")
            response.headers["Content-Security-Policy"] = _VIEW_POLICY if of_view else _POLICY
        return response

    def _enter(self, token: str) -> "web.StreamResponse":
        """Exchange the token, which is then used up, for a cookie."""
        from aiohttp import web

        is_invited = self._is_invited(token)
        if not is_invited and not hmac.compare_digest(token.encode(), self._token.encode()):
            return self._refuse("that token is not valid (any more); open the address that `goshawk gcs` printed last")
        if is_invited:
            self.end_invitation()
        else:
            self._token = secrets.token_urlsafe(24)
        cookie = self._entrants.admit()
        entry = web.HTTPFound("/")
        entry.set_cookie(self._cookie, cookie, httponly=True, samesite="Strict", secure=self._tls is not None)
        if is_invited:
            self.on_invited()
        else:
            self.on_entry(self.url)
        return entry

    @property
    def _cookie(self) -> str:
        return f"goshawk_{self.port}"  # cookies ignore ports: two stations on one machine must not share one

    def _refuse(self, reason: str, *, status: int = 403) -> "web.Response":
        from aiohttp import web

        self.refused += 1
        logger.warning("refused: %s", reason)
        refusal = web.Response(status=status, text=f"Goshawk: {reason}\n")
        refusal.force_close()
        return refusal

    async def _index(self, request: "web.Request") -> "web.StreamResponse":
        return _unless_known(request, (STATIC / "index.html").read_bytes(), "text/html")

    async def _file(self, request: "web.Request") -> "web.StreamResponse":
        from aiohttp import web

        name = request.match_info["name"]
        if name not in {path.name for path in STATIC.iterdir()}:
            raise web.HTTPNotFound
        answer = _unless_known(request, (STATIC / name).read_bytes(), mimetypes.guess_type(name)[0] or "text/plain")
        if name == "worker.js":
            answer.headers["Service-Worker-Allowed"] = "/"  # it keeps the page, which is above its own folder
        return answer

    async def _serve_state(self, request: "web.Request") -> "web.Response":
        from aiohttp import web

        return web.json_response(await asyncio.to_thread(self._state))

    async def _take_log(self, request: "web.Request") -> "web.Response":
        """Write a flight log into the folder for incoming ones, whole or not at all; it is read by command later."""
        from aiohttp import web

        try:
            place = self._incoming(request.match_info["name"])
        except InputError as error:
            return web.Response(status=400, text=str(error))
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=place.parent, prefix=".", delete=False) as file:
            temporary = Path(file.name)
            try:
                size = 0
                while data := await asyncio.wait_for(request.content.read(1 << 16), BODY_PAUSE_S):
                    size += len(data)
                    if size > LARGEST_LOG:
                        said = f"{place.name} is larger than {LARGEST_LOG >> 30} GiB; `goshawk log check` reads it"
                        return web.Response(status=413, text=said)
                    file.write(data)
                file.close()
                temporary.replace(place)
            except TimeoutError:
                return web.Response(status=408, text=f"{place.name} stopped coming; send it again")
            except OSError as error:
                return web.Response(status=507, text=f"{place.name} could not be written ({error.strerror})")
            finally:
                temporary.unlink(missing_ok=True)
        return web.Response(text=place.name)

    async def _serve_shared(self, request: "web.Request") -> "web.Response":
        return await self._serve_file(self._share, request)

    async def _serve_report(self, request: "web.Request") -> "web.Response":
        return await self._serve_file(self._report, request)

    async def _serve_file(self, ask: Callable[[str], tuple[str, str]], request: "web.Request") -> "web.Response":
        """Name and text of an HTML file, to be kept and never shown inside this page."""
        from aiohttp import web

        try:
            name, text = await asyncio.to_thread(ask, request.query.get("name", ""))
        except FlightError as error:
            return web.Response(status=404, text=f"Goshawk: {error}\n")
        file = f"attachment; filename*=UTF-8''{quote(f'{name}.html')}"
        return web.Response(text=text, content_type="text/html", headers={"Content-Disposition": file})

    async def _serve_data(self, request: "web.Request") -> "web.StreamResponse":
        """A CSV in pieces: a long flight's need not be in memory together."""
        from aiohttp import web

        async with self._exporting:  # each is work for a processor: one after the other
            try:
                pieces = iter(await asyncio.to_thread(self._data, request.query))
            except FlightError as error:
                return web.Response(status=404, text=f"Goshawk: {error}\n")
            kind, content = _TABLES[request.query.get("as") == "parquet"]
            name = quote(f"{request.query.get('flight', '')}.{kind}")
            answer = web.StreamResponse(headers={**_SAFETY_HEADERS, "Cache-Control": "no-store"})
            answer.headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{name}"
            answer.headers["Content-Type"] = content
            await answer.prepare(request)
            try:
                while piece := await asyncio.to_thread(next, pieces, b""):
                    await asyncio.wait_for(answer.write(piece), BODY_PAUSE_S)
            except TimeoutError:
                logger.warning("a table was not taken within %g s; it is cut off", BODY_PAUSE_S)
                if request.transport is not None:
                    request.transport.abort()
                return answer
            await answer.write_eof()
        return answer

    async def _page(self, request: "web.Request") -> "web.StreamResponse":
        from aiohttp import web

        socket = web.WebSocketResponse(max_msg_size=LARGEST_MESSAGE, heartbeat=PING_S)
        await socket.prepare(request)
        own = request.transport.get_extra_info("sockname") if request.transport is not None else None
        is_here = own is not None and own[0] == request.remote
        self._sockets += 1
        try:
            await self._serve_page(socket, is_here)
        finally:
            self._sockets -= 1
        return socket

    async def _pass_on(self, request: "web.Request") -> "web.StreamResponse":
        from aiohttp import web

        assert self._client is not None
        path = request.match_info["path"]
        encoding = (
            request.headers.get("Accept-Encoding", "identity") if path else "identity"
        )  # its page is changed here
        headers = {"Accept": request.headers.get("Accept", "*/*"), "Accept-Encoding": encoding}
        async with self._client.get(f"http://{self._upstream}/{path}", headers=headers) as answer:
            body = await answer.read()
            kept = {name: value for name, value in answer.headers.items() if name.lower() not in _HOP_HEADERS}
            if (encoded := answer.headers.get("Content-Encoding", "identity")) != "identity":
                kept["Content-Encoding"] = encoded
            if path or answer.status != 200:
                return web.Response(status=answer.status, body=body, headers=kept)
            body = body.replace(b"</head>", _VIEW_STYLE, 1)
            return _unless_known(request, body, "text/html")

    async def _pass_socket(self, request: "web.Request") -> "web.StreamResponse":
        from aiohttp import web

        offered = [p.strip() for p in request.headers.get("Sec-WebSocket-Protocol", "").split(",") if p.strip()]
        browser = web.WebSocketResponse(
            protocols=offered, max_msg_size=LARGEST_MESSAGE, compress=False, heartbeat=PING_S
        )
        await browser.prepare(request)
        assert self._client is not None
        self._sockets += 1
        try:
            address = f"ws://{self._upstream}/{request.match_info.get('view', '')}"
            async with self._client.ws_connect(address, protocols=offered, max_msg_size=0, compress=0) as server:
                downward = asyncio.create_task(_pump(server, browser, allow=lambda _: True))
                upward = asyncio.create_task(_pump(browser, server, allow=_may_pass))
                _, pending = await asyncio.wait({downward, upward}, return_when=asyncio.FIRST_COMPLETED)
                for task in pending:
                    task.cancel()
                await asyncio.gather(*pending, return_exceptions=True)
            await browser.close()
        finally:
            self._sockets -= 1
        return browser


def _unless_known(request: "web.Request", body: bytes, kind: str) -> "web.Response":
    """A text, or only that the browser has it already; it asks each time, so that it is never an old one."""
    from aiohttp import web

    tag = f'W/"{hashlib.sha256(body).hexdigest()[:32]}"'
    if request.headers.get("If-None-Match") == tag:
        return web.Response(status=304, headers={"ETag": tag})
    return web.Response(body=body, content_type=kind, charset="utf-8", headers={"ETag": tag})


async def _pump(source: Any, sink: Any, *, allow: Callable[[bytes], bool]) -> None:
    """Pass binary messages from one socket to the other until either closes."""
    from aiohttp import ClientConnectionResetError, WSMsgType

    with contextlib.suppress(ClientConnectionResetError):  # `sink` has closed
        async for message in source:
            if message.type == WSMsgType.BINARY:
                if allow(message.data):
                    await sink.send_bytes(message.data)
            else:
                return


def _may_pass(data: bytes) -> bool:
    """Whether a browser's message may reach viser: well-formed, and not about publishing the page."""
    import msgspec

    try:
        kind = msgspec.msgpack.decode(data).get("type")
    except (msgspec.DecodeError, AttributeError):
        return False
    if kind in REFUSED_MESSAGES:
        logger.warning("refused to publish the page on a share server")
        return False
    return True
