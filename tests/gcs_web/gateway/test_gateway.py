"""Who the gateway lets in: real sockets, a real viser server behind it."""

import asyncio
import gzip
import shutil
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import quote

import aiohttp
import aiohttp.web
import msgspec
import pytest
import viser
import yarl

from flight.project import Project
from gcs_web.gateway import gateway as rules
from gcs_web.gateway.gateway import LARGEST_MESSAGE, MOST_SOCKETS, Gateway
from gcs_web.jobs import incoming
from tests.waiting import PATIENCE_S


async def echo(socket: aiohttp.web.WebSocketResponse, _: bool) -> None:
    """Stands where the page's commands are served."""
    async for message in socket:
        await socket.send_str(message.data)


@asynccontextmanager
async def running_gateway() -> AsyncIterator[tuple[Gateway, viser.ViserServer]]:
    server = viser.ViserServer(host="127.0.0.1", port=18080, verbose=False)
    folder = Path(tempfile.mkdtemp())
    gateway = Gateway(
        server.get_port(),
        serve_page=echo,
        state=lambda: {"answer": 42},
        incoming=lambda name: incoming.place(Project(folder, ""), name),
        share=lambda name: (name, ""),
        report=lambda name: (name, ""),
        data=lambda asked: iter([f"{asked['flight']}\n".encode()]),
    )
    try:
        await gateway.start()
        yield gateway, server
    finally:
        await gateway.stop()
        server.stop()
        shutil.rmtree(folder)


def at_the_gateway(visit):
    """Run a coroutine function with a running gateway and a fresh browser-like session that keeps cookies."""

    async def run():
        async with running_gateway() as (gateway, server):
            jar = aiohttp.CookieJar(unsafe=True)
            async with aiohttp.ClientSession(cookie_jar=jar) as browser:
                await visit(gateway, server, browser)

    asyncio.run(run())


def test_a_flight_log_is_taken_whole_and_only_from_a_browser_that_came_in():
    async def visit(gateway, server, browser):
        base = f"http://127.0.0.1:{gateway.port}/incoming/"
        async with browser.put(base + "pond.csv", data=b"1,2") as answer:
            assert answer.status == 403
        async with browser.get(gateway.url):
            pass
        data = bytes(3 * LARGEST_MESSAGE)
        async with browser.put(base + "pond.csv", data=data) as answer:
            assert (answer.status, await answer.text()) == (200, "pond.csv")
        assert gateway._incoming("pond.csv").read_bytes() == data
        for name in ("..%2Fproject.csv", "page.html", ".csv"):
            async with browser.put(yarl.URL(base + name, encoded=True), data=b"x") as answer:
                assert answer.status in (400, 404)
        async with browser.put(base + "b.csv", data=b"x", headers={"Origin": "http://evil.example"}) as answer:
            assert answer.status == 403
        assert [path.name for path in gateway._incoming("pond.csv").parent.iterdir()] == ["pond.csv"]

    at_the_gateway(visit)


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
            assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
            assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
        base = f"http://127.0.0.1:{gateway.port}"
        async with browser.get(f"{base}/state") as answer:
            assert await answer.json() == {"answer": 42}
        async with browser.get(f"{base}/viser/") as answer:
            assert ".mantine-Paper-root" in await answer.text()
            assert answer.headers["X-Frame-Options"] == "SAMEORIGIN"

    at_the_gateway(visit)


FIRST_LOAD_BYTES, VIEW_BYTES = 150_000, 690_000
"""As sent, of page, code and style, which draw a map of their own; and of the 3D view, which is loaded after them."""


def test_page_and_3d_view_are_sent_compressed_and_whole():
    async def visit(gateway, server, browser):
        base = f"http://127.0.0.1:{gateway.port}"
        async with browser.get(gateway.url):
            pass
        sent: dict[str, int] = {}
        for path in ("/", "/static/app.js", "/static/app.css", "/viser/"):
            async with browser.get(base + path, headers={"Accept-Encoding": "identity"}) as answer:
                plain = await answer.read()
                assert "Content-Encoding" not in answer.headers
            async with browser.get(base + path, headers={"Accept-Encoding": "gzip"}) as answer:
                assert await answer.read() == plain  # the client has unpacked it
                assert answer.headers["Content-Encoding"] == "gzip"
                assert "Content-Security-Policy" in answer.headers
            sent[path] = len(gzip.compress(plain, 6))
        assert sent.pop("/viser/") <= VIEW_BYTES
        assert sum(sent.values()) <= FIRST_LOAD_BYTES

    at_the_gateway(visit)


def test_the_token_works_once_and_the_next_address_is_told():
    async def visit(gateway, server, browser):
        told = []
        gateway.on_entry = told.append
        first = gateway.url
        async with browser.get(first) as answer:
            assert answer.status == 200
        assert told == [gateway.url]
        assert gateway.url != first
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as other:
            async with other.get(first) as answer:
                assert answer.status == 403
            async with other.get(gateway.url) as answer:
                assert answer.status == 200
        async with browser.get(f"http://127.0.0.1:{gateway.port}/state") as answer:
            assert answer.status == 200

    at_the_gateway(visit)


def test_an_invitation_is_good_once_and_for_its_time_and_the_stations_own_token_stays(monkeypatch):
    async def visit(gateway, server, browser):
        used: list[str] = []
        gateway.on_invited = lambda: used.append("in")
        own = gateway.url
        address, is_new = gateway.invite()
        assert is_new
        assert gateway.invite() == (address, False)
        assert address != own
        for expected in (302, 403):
            async with browser.get(address, allow_redirects=False) as answer:
                assert answer.status == expected
        assert used == ["in"]
        assert gateway.url == own
        ended, _ = gateway.invite()
        gateway.end_invitation()
        late, _ = gateway.invite()
        monkeypatch.setattr(rules, "INVITATION_S", -1.0)
        for address in (ended, late):
            async with browser.get(address, allow_redirects=False) as answer:
                assert answer.status == 403

    at_the_gateway(visit)


def test_the_files_of_the_page_cannot_be_left():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        base = f"http://127.0.0.1:{gateway.port}/static"
        for path in ("/../gateway.py", "/%2e%2e/gateway.py", "/..%2fgateway.py", "//etc/passwd", "/"):
            async with browser.get(yarl.URL(base + path, encoded=True)) as answer:
                assert answer.status in (403, 404)

    at_the_gateway(visit)


def test_a_message_beyond_the_bound_closes_its_socket_and_no_other():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}) as good:
            async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}) as bad:
                await bad.send_str("x" * (LARGEST_MESSAGE + 1))
                closed = await asyncio.wait_for(bad.receive(), PATIENCE_S)
                assert closed.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
            await good.send_str("still here")
            assert await asyncio.wait_for(good.receive_str(), PATIENCE_S) == "still here"

    at_the_gateway(visit)


def test_more_sockets_than_the_bound_are_refused_until_one_closes():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        headers = {"Origin": origin}
        sockets = [await browser.ws_connect(f"{origin}/ws", headers=headers) for _ in range(MOST_SOCKETS)]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
            await browser.ws_connect(f"{origin}/ws", headers=headers)
        assert refusal.value.status == 503
        await sockets.pop().close()
        await asyncio.sleep(0)
        end_s = asyncio.get_running_loop().time() + PATIENCE_S
        while True:
            try:
                sockets.append(await browser.ws_connect(f"{origin}/ws", headers=headers))
                break
            except aiohttp.WSServerHandshakeError:
                assert asyncio.get_running_loop().time() < end_s
                await asyncio.sleep(0.05)
        for socket in sockets:
            await socket.close()

    at_the_gateway(visit)


@pytest.mark.parametrize("header", [{"Host": "evil.example"}, {"Host": "evil.example:80"}])
def test_a_foreign_name_is_refused_even_with_the_token(header):
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url, headers=header, allow_redirects=False) as answer:
            assert answer.status == 403

    at_the_gateway(visit)


def test_at_the_usual_port_browsers_leave_it_out_of_their_host_and_origin():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        base = f"http://127.0.0.1:{gateway.port}"
        cookies = {"goshawk_80": browser.cookie_jar.filter_cookies(yarl.URL(base))[f"goshawk_{gateway.port}"].value}
        gateway.port = 80  # as it would be if this test might listen there
        async with aiohttp.ClientSession(cookies=cookies, cookie_jar=aiohttp.CookieJar(unsafe=True)) as other:
            for host, status in (("127.0.0.1", 200), ("localhost:80", 200), ("evil.example", 403)):
                async with other.get(f"{base}/state", headers={"Host": host}) as answer:
                    assert answer.status == status

    at_the_gateway(visit)


@pytest.mark.parametrize("path", ["/static/app.js", "/viser/", "/viser/of/0123456789abcdef/"])
def test_what_a_browser_has_is_not_sent_again_and_what_changes_is_never_kept(path):
    async def visit(gateway, server, browser):
        base = f"http://127.0.0.1:{gateway.port}"
        async with browser.get(gateway.url):
            pass
        async with browser.get(base + path) as answer:
            tag = answer.headers["ETag"]
            assert answer.headers["Cache-Control"] == "private, no-cache"
        async with browser.get(base + path, headers={"If-None-Match": tag}) as answer:
            assert answer.status == 304
            assert await answer.read() == b""
        async with browser.get(base + path, headers={"If-None-Match": 'W/"another"'}) as answer:
            assert answer.status == 200
            assert len(await answer.read()) > 10_000
        async with browser.get(f"{base}/state") as answer:
            assert answer.headers["Cache-Control"] == "no-store"

    at_the_gateway(visit)


@pytest.mark.parametrize(("given", "passed"), [("/viser", ""), ("/viser/of/0123456789abcdef", "0123456789abcdef")])
def test_the_3d_view_of_a_page_is_known_by_the_name_that_the_page_gave_it(given, passed):
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        asked = {"headers": {"Origin": origin}, "protocols": [f"viser-v{viser.__version__}"], "max_msg_size": 0}
        async with browser.ws_connect(f"{origin}{given}", **asked) as socket:
            await asyncio.wait_for(socket.receive(), PATIENCE_S)
            (connection,) = server._websock_server._live_connections.values()
            assert connection.request.path.rpartition("/")[2] == passed

    at_the_gateway(visit)


@pytest.mark.parametrize("name", ["short", "../../x", "0123456789abcdeg", "a" * 99])
def test_a_name_of_a_3d_view_that_no_page_gives_is_refused(name):
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await browser.ws_connect(f"{origin}/viser/of/{quote(name, safe='')}", headers={"Origin": origin})

    at_the_gateway(visit)


def test_a_socket_from_a_foreign_page_is_refused():
    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        for path in ("/ws", "/viser", "/viser/of/0123456789abcdef", "/viser/"):
            address = f"ws://127.0.0.1:{gateway.port}{path}"
            for headers in ({"Origin": "http://evil.example"}, {}):
                with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                    await browser.ws_connect(address, headers=headers)
                assert refusal.value.status == 403

    at_the_gateway(visit)


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "])
def test_a_connection_without_a_whole_request_is_closed(sent, monkeypatch):
    monkeypatch.setattr(rules, "SILENCE_S", 0.2)

    async def visit(gateway, server, browser):
        reader, writer = await asyncio.open_connection("127.0.0.1", gateway.port)
        writer.write(sent)
        answer = await asyncio.wait_for(reader.read(), PATIENCE_S)  # ends where the gateway closes
        writer.close()
        assert answer == b""

    at_the_gateway(visit)


@pytest.mark.parametrize("path", ["/ws", "/viser"])
def test_a_socket_whose_browser_answers_no_ping_is_closed_and_frees_its_place(path, monkeypatch):
    monkeypatch.setattr(rules, "PING_S", 0.2)

    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        protocols = (f"viser-v{viser.__version__}",) if path == "/viser" else ()
        asked = {"headers": {"Origin": origin}, "protocols": protocols, "autoping": False}
        async with browser.ws_connect(f"{origin}{path}", **asked):
            assert gateway._sockets == 1
            end_s = asyncio.get_running_loop().time() + PATIENCE_S
            while gateway._sockets:  # it never reads, so it answers nothing
                assert asyncio.get_running_loop().time() < end_s
                await asyncio.sleep(0.05)

    at_the_gateway(visit)


def test_a_flight_log_that_stops_coming_is_given_up_and_leaves_nothing(monkeypatch):
    monkeypatch.setattr(rules, "BODY_PAUSE_S", 0.2)

    async def visit(gateway, server, browser):
        async with browser.get(gateway.url):
            pass
        over = asyncio.Event()

        async def stalling():
            yield b"time_s,x_m\n"
            await over.wait()

        async with browser.put(f"http://127.0.0.1:{gateway.port}/incoming/pond.csv", data=stalling()) as answer:
            assert answer.status == 408
        over.set()
        assert list(gateway._incoming("pond.csv").parent.iterdir()) == []

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
            f"ws://127.0.0.1:{gateway.port}/viser", headers={"Origin": origin}, protocols=[protocol], max_msg_size=0
        ) as socket:
            first = await asyncio.wait_for(socket.receive(), PATIENCE_S)
            assert first.type == aiohttp.WSMsgType.BINARY
            await socket.send_bytes(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
            await socket.send_bytes(b"not msgpack at all")
            await asyncio.sleep(0.5)
            assert not socket.closed
        assert shared == []

    at_the_gateway(visit)


def test_what_is_passed_to_a_browser_that_has_left_ends_without_an_error():
    async def visit(gateway, server, browser):
        ended = asyncio.get_running_loop().create_future()

        async def messages():
            yield aiohttp.WSMessage(aiohttp.WSMsgType.BINARY, b"scene", None)

        async def leave_and_send(socket, _):
            socket._req.transport.abort()
            task = asyncio.create_task(rules._pump(messages(), socket, allow=lambda _: True))
            await asyncio.wait({task})
            ended.set_result(task.exception())

        gateway._serve_page = leave_and_send
        async with browser.get(gateway.url):
            pass
        origin = f"http://127.0.0.1:{gateway.port}"
        async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}):
            assert await asyncio.wait_for(ended, PATIENCE_S) is None

    at_the_gateway(visit)


def test_a_host_is_answered_to_as_browsers_write_it(tmp_path: Path):
    """They send names in small letters; one that was given in others let nobody in."""
    gateway = Gateway(
        1,
        serve_page=echo,
        state=dict,
        incoming=lambda name: tmp_path / name,
        share=lambda name: (name, ""),
        report=lambda name: (name, ""),
        data=lambda asked: iter([f"{asked['flight']}\n".encode()]),
        host="Station.Org",
    )
    assert gateway.url.startswith("http://station.org:")
