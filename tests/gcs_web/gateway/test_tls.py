"""The page over TLS: a certificate made here with openssl, a real station behind it, and files that are no good."""

import asyncio
import shutil
import ssl
import subprocess
from collections.abc import Callable
from pathlib import Path

import aiohttp
import numpy as np
import pytest

import vehicle
from flight import InputError, Waypoints, project
from gcs_web import GroundStation
from gcs_web.gateway import tls
from tests.gcs_web.two_pillars import add_map
from tests.waiting import PATIENCE_S, goshawk

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl to make certificates")

Pair = tuple[Path, Path]


_AUTHORITY = """
[ca]
default_ca = own
[own]
database = {folder}/index
serial = {folder}/serial
new_certs_dir = {folder}
default_md = sha256
policy = any
copy_extensions = copy
[any]
commonName = supplied
"""
"""Of `openssl ca`, the only command of OpenSSL 3.0 that takes dates."""


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., Pair]:
    """`made(name, ...)` makes a self-signed certificate for 127.0.0.1 and localhost, and its key."""
    config = tmp_path / "ca.conf"
    config.write_text(_AUTHORITY.format(folder=tmp_path))
    (tmp_path / "index").touch()
    (tmp_path / "serial").write_text("01")

    def run(*command: object) -> None:
        subprocess.run(["openssl", *command], check=True, capture_output=True)

    def make(name: str, *, names: str = "IP:127.0.0.1,DNS:localhost", dates: tuple[str, ...] = ("-days", "2")) -> Pair:
        certificate, key, request = (tmp_path / f"{name}.{suffix}" for suffix in ("pem", "key", "csr"))
        curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-noenc")
        asked = ("-subj", f"/CN={name}", "-addext", f"subjectAltName={names}")
        run("req", *curve, *asked, "-keyout", key, "-out", request)
        signed = ("-selfsign", "-batch", "-notext", "-config", config, "-keyfile", key)
        run("ca", *signed, *dates, "-in", request, "-out", certificate)
        return certificate, key

    return make


@pytest.fixture
def folder(pillar_map: Path, tmp_path: Path) -> Path:
    opened = project.create(tmp_path / "project", "two pillars")
    add_map(opened, pillar_map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    points = np.array([[0.8, 0.8, 1.0], [5.2, 0.8, 1.2]])
    project.save_waypoints(opened.waypoints, Waypoints(points, np.full(2, np.nan)))
    return opened.folder


def test_the_page_its_socket_and_the_3d_view_are_served_over_tls_with_a_secure_cookie(made, folder):
    certificate, key = made("good")

    async def visit(station: GroundStation) -> None:
        trusting = ssl.create_default_context(cafile=certificate)
        jar = aiohttp.CookieJar(unsafe=True)
        connector = aiohttp.TCPConnector(ssl=trusting)
        async with aiohttp.ClientSession(cookie_jar=jar, connector=connector) as browser:
            origin = station.url.split("/?")[0]
            assert origin.startswith("https://127.0.0.1:")
            async with browser.get(station.url, allow_redirects=False) as entry:
                cookie = entry.headers["Set-Cookie"]
            assert all(word in cookie for word in ("Secure", "HttpOnly", "SameSite=Strict"))
            async with browser.get(f"{origin}/viser/") as answer:
                assert answer.status == 200
            address = origin.replace("https", "wss") + "/ws"
            async with browser.ws_connect(address, headers={"Origin": origin}) as socket:
                welcome = await asyncio.wait_for(socket.receive_json(), PATIENCE_S)
                assert welcome["type"] == "welcome"
            with pytest.raises(aiohttp.WSServerHandshakeError):  # a page that was not served over TLS
                await browser.ws_connect(address, headers={"Origin": origin.replace("https", "http")})
        async with aiohttp.ClientSession() as plain:
            with pytest.raises(aiohttp.ClientError):
                await plain.get(station.url.replace("https", "http"))

    with GroundStation(folder, triangles=500, tls=(certificate, key)) as station:
        asyncio.run(visit(station))


def test_a_pair_that_does_not_belong_together_is_refused_in_words(made):
    with pytest.raises(InputError, match="does not belong to the certificate"):
        tls.context(made("one")[0], made("two")[1], "127.0.0.1")


@pytest.mark.parametrize(
    ("dates", "said"),
    [
        (("-startdate", "20200101000000Z", "-enddate", "20210101000000Z"), "certificate has expired; renew it"),
        (("-startdate", "20900101000000Z", "-enddate", "20910101000000Z"), "not yet valid; look at this machine's"),
    ],
)
def test_a_certificate_that_is_not_valid_today_is_refused_in_words(made, dates, said):
    with pytest.raises(InputError, match=said):
        tls.context(*made("dated", dates=dates), "127.0.0.1")


def test_a_certificate_for_another_name_is_refused_in_words(made):
    certificate, key = made("other", names="DNS:station.example")
    with pytest.raises(InputError, match="--host the name that it is for"):
        tls.context(certificate, key, "127.0.0.1")
    tls.context(certificate, key, "station.example")


def test_files_that_are_missing_damaged_or_locked_are_refused_in_words(made, tmp_path):
    certificate, key = made("good")
    with pytest.raises(InputError, match="--tls-key: there is no file"):
        tls.context(certificate, tmp_path / "nowhere.key", "127.0.0.1")
    with pytest.raises(InputError, match="not a certificate and a key in PEM format"):
        tls.context(key, certificate, "127.0.0.1")
    cut = tmp_path / "cut.pem"
    cut.write_bytes(certificate.read_bytes()[:200])
    with pytest.raises(InputError, match="not a certificate and a key in PEM format"):
        tls.context(cut, key, "127.0.0.1")
    locked = tmp_path / "locked.key"
    command = ["openssl", "pkey", "-in", key, "-aes256", "-passout", "pass:secret", "-out", locked]
    subprocess.run(command, check=True, capture_output=True)
    with pytest.raises(InputError, match="has a password; give one without"):
        tls.context(certificate, locked, "127.0.0.1")


def test_another_machine_is_not_let_in_without_a_certificate(folder, made):
    with pytest.raises(InputError, match=r"0\.0\.0\.0 can be reached from other machines: give --tls-cert"):
        GroundStation(folder, host="0.0.0.0", triangles=500)
    half = goshawk("gcs", folder, "--tls-cert", made("good")[0])
    assert half.returncode == 2
    assert "belong together; give both" in half.stderr
