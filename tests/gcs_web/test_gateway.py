"""Who the gateway lets in: real sockets, a real viser server behind it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import aiohttp
import msgspec
import pytest
import viser

from gcs_web.gateway import Gateway, new_token
from tests.waiting import PATIENCE_S


@asynccontextmanager
async def running_gateway() -> AsyncIterator[tuple[Gateway, viser.ViserServer]]:
    server = viser.ViserServer(host="127.0.0.1", port=18080, verbose=False)
    gateway = Gateway(server.get_port(), token=new_token(), state=lambda: {"answer": 42})
    try:
        await gateway.start()
        yield gateway, server
    finally:
        await gateway.stop()
        server.stop()


def at_the_gateway(visit):
    """Run a coroutine function with a running gateway and a fresh browser-like session that keeps cookies."""

    async def run():
        async with running_gateway() as (gateway, server):
            jar = aiohttp.CookieJar(unsafe=True)
            async with aiohttp.ClientSession(cookie_jar=jar) as browser:
                await visit(gateway, server, browser)

    asyncio.run(run())


def test_a_request_without_the_token_is_refused():
    async def visit(gateway, server, browser):
        base = f"http://127.0.0.1:{gateway.port}"
        for path in ("/", "/state", "/?token=wrong", "/state?token="):
            async with browser.get(base + path) as answer:
                assert answer.status == 403
                assert "goshawk gcs" in await answer.text()
        assert gateway.refused == 4

    at_the_gateway(visit)


def test_the_printed_address_opens_the_page_and_the_state():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url) as answer:
            assert answer.status == 200
            assert "token" not in str(answer.url)
            assert "<html" in (await answer.text()).lower()
            assert answer.headers["X-Frame-Options"] == "DENY"
        async with browser.get(f"http://127.0.0.1:{gateway.port}/state") as answer:
            assert await answer.json() == {"answer": 42}

    at_the_gateway(visit)


@pytest.mark.parametrize("header", [{"Host": "evil.example"}, {"Host": "evil.example:80"}])
def test_a_foreign_name_is_refused_even_with_the_token(header):
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url, headers=header, allow_redirects=False) as answer:
            assert answer.status == 403

    at_the_gateway(visit)


def test_a_socket_from_a_foreign_page_is_refused():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        address = f"ws://127.0.0.1:{gateway.port}/"
        for headers in ({"Origin": "http://evil.example"}, {}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                await browser.ws_connect(address, headers=headers)
            assert refusal.value.status == 403

    at_the_gateway(visit)


def test_scene_messages_pass_and_share_requests_do_not():
    async def visit(gateway, server, browser):
        shared = []
        server.request_share_url = lambda: shared.append(True)
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        protocol = f"viser-v{viser.__version__}"
        async with browser.ws_connect(
            f"ws://127.0.0.1:{gateway.port}/", headers={"Origin": origin}, protocols=[protocol], max_msg_size=0
        ) as socket:
            first = await asyncio.wait_for(socket.receive(), PATIENCE_S)
            assert first.type == aiohttp.WSMsgType.BINARY
            await socket.send_bytes(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
            await socket.send_bytes(b"not msgpack at all")
            await asyncio.sleep(0.5)
            assert not socket.closed
        assert shared == []

    at_the_gateway(visit)
