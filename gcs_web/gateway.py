"""The ground station's gateway: authentication, origin checks and a message filter in front of viser.

viser listens on a random loopback port and has no authentication: any program or web page that reached it could press
"Upload". So the browser connects to this gateway. It checks the Host header (against DNS rebinding), the token (given
once in the address, then kept as a cookie) and the Origin of every WebSocket, drops the messages that would publish
the page on viser's share server, and forwards the rest.
"""

import asyncio
import hmac
import logging
import secrets
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aiohttp import ClientSession, web

logger = logging.getLogger(__name__)

LOOPBACK = "127.0.0.1"
REFUSED_MESSAGES = frozenset({"ShareUrlRequest", "ShareUrlDisconnect"})
_HOP_HEADERS = frozenset({"connection", "transfer-encoding", "content-length", "content-encoding", "date", "server"})
_SAFETY_HEADERS = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}

State = Callable[[], dict[str, Any]]
Handler = Callable[["web.Request"], Awaitable["web.StreamResponse"]]


def new_token() -> str:
    return secrets.token_urlsafe(24)


class Gateway:
    """Serves `http://127.0.0.1:PORT/?token=...` in front of a viser server on another loopback port."""

    def __init__(self, upstream_port: int, *, token: str, state: State, port: int = 0) -> None:
        """`state` supplies the JSON of `/state`: the session's state. Port 0 lets the system choose."""
        self._upstream = f"{LOOPBACK}:{upstream_port}"
        self._token = token
        self._state = state
        self._requested_port = port
        self._runner: web.AppRunner | None = None
        self._client: ClientSession | None = None
        self.port = 0
        self.refused = 0

    @property
    def url(self) -> str:
        """The address to open in a browser, token included."""
        return f"http://{LOOPBACK}:{self.port}/?token={self._token}"

    async def start(self) -> None:
        """Listen. Raises `OSError` if the port is taken."""
        from aiohttp import ClientSession, ClientTimeout, web

        @web.middleware  # the decorator takes functions, not methods
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._guard(request, handler)

        application = web.Application(middlewares=[guard])
        application.router.add_get("/state", self._serve_state)
        application.router.add_get("/{path:.*}", self._forward)
        self._client = ClientSession(timeout=ClientTimeout(total=60), auto_decompress=False)
        self._runner = web.AppRunner(application, access_log=None)
        await self._runner.setup()
        site = web.TCPSite(self._runner, LOOPBACK, self._requested_port)
        await site.start()
        assert site._server is not None
        self.port = site._server.sockets[0].getsockname()[1]  # type: ignore[attr-defined]

    async def stop(self) -> None:
        if self._client is not None:
            await self._client.close()
        if self._runner is not None:
            await self._runner.cleanup()

    async def _guard(self, request: "web.Request", handler: "Handler") -> "web.StreamResponse":
        """Check Host, then token, then Origin, so that the refusal names the first that is wrong."""
        from aiohttp import web

        names = {f"{LOOPBACK}:{self.port}", f"localhost:{self.port}"}
        if request.host not in names:
            return self._refuse(f"this ground station answers to {LOOPBACK}:{self.port}, not to {request.host!r}")
        given = request.query.get("token")
        if given is not None:
            if not hmac.compare_digest(given.encode(), self._token.encode()):
                return self._refuse("that token is not valid; open the address that `goshawk gcs` printed last")
            entry = web.HTTPFound("/")
            entry.set_cookie(self._cookie, self._token, httponly=True, samesite="Strict")
            return entry
        if not hmac.compare_digest(request.cookies.get(self._cookie, "").encode(), self._token.encode()):
            return self._refuse("a token is needed; open the address that `goshawk gcs` printed")
        origin = request.headers.get("Origin")
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        if (origin is not None or is_socket) and origin not in {f"http://{name}" for name in names}:
            return self._refuse(f"a page from {origin!r} may not connect to this ground station")
        response = await handler(request)
        if not response.prepared:
            response.headers.update(_SAFETY_HEADERS)
        return response

    @property
    def _cookie(self) -> str:
        return f"goshawk_{self.port}"  # cookies ignore ports: two stations on one machine must not share one

    def _refuse(self, reason: str) -> "web.Response":
        from aiohttp import web

        self.refused += 1
        logger.warning("refused: %s", reason)
        return web.Response(status=403, text=f"Goshawk: {reason}\n")

    async def _serve_state(self, request: "web.Request") -> "web.Response":
        from aiohttp import web

        return web.json_response(self._state())

    async def _forward(self, request: "web.Request") -> "web.StreamResponse":
        from aiohttp import web

        if request.headers.get("Upgrade", "").lower() == "websocket":
            return await self._forward_socket(request)
        assert self._client is not None
        headers = {name: request.headers[name] for name in ("Accept", "Accept-Encoding") if name in request.headers}
        async with self._client.get(f"http://{self._upstream}{request.path}", headers=headers) as answer:
            body = await answer.read()
            kept = {name: value for name, value in answer.headers.items() if name.lower() not in _HOP_HEADERS}
            if "Content-Encoding" in answer.headers:
                kept["Content-Encoding"] = answer.headers["Content-Encoding"]
            return web.Response(status=answer.status, body=body, headers=kept)

    async def _forward_socket(self, request: "web.Request") -> "web.StreamResponse":
        from aiohttp import web

        offered = [p.strip() for p in request.headers.get("Sec-WebSocket-Protocol", "").split(",") if p.strip()]
        browser = web.WebSocketResponse(protocols=offered, max_msg_size=0, compress=False)
        await browser.prepare(request)
        assert self._client is not None
        address = f"ws://{self._upstream}{request.path}"
        async with self._client.ws_connect(address, protocols=offered, max_msg_size=0, compress=0) as server:
            downward = asyncio.create_task(_pump(server, browser, allow=lambda _: True))
            upward = asyncio.create_task(_pump(browser, server, allow=_is_allowed))
            _, pending = await asyncio.wait({downward, upward}, return_when=asyncio.FIRST_COMPLETED)
            for task in pending:
                task.cancel()
            await asyncio.gather(*pending, return_exceptions=True)
        await browser.close()
        return browser


async def _pump(source: Any, sink: Any, *, allow: Callable[[bytes], bool]) -> None:
    """Forward binary messages from one socket to the other until either closes."""
    from aiohttp import WSMsgType

    async for message in source:
        if message.type == WSMsgType.BINARY:
            if allow(message.data):
                await sink.send_bytes(message.data)
        else:
            return


def _is_allowed(data: bytes) -> bool:
    """Whether a browser's message is forwarded to viser: well-formed, and no request to publish the page."""
    import msgspec

    try:
        kind = msgspec.msgpack.decode(data).get("type")
    except (msgspec.DecodeError, AttributeError):
        return False
    if kind in REFUSED_MESSAGES:
        logger.warning("refused to publish the page on a share server")
        return False
    return True
