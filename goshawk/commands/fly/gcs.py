"""`goshawk gcs`: the ground station's page, until Ctrl-C."""

import json
import queue
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click

from flight import FlightError
from goshawk.terminal import console

SUMMARY = "Serve the ground station's page."


@click.command()
@click.argument("project", type=click.Path(path_type=Path), required=False)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=8080,
    show_default=True,
    help="Port to listen at; 0 takes a free one.",
)
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Name or address to listen at; others need a certificate."
)
@click.option("--tls-cert", type=click.Path(path_type=Path), help="Certificate (PEM) for HOST: the page is https.")
@click.option("--tls-key", type=click.Path(path_type=Path), help="Its private key (PEM, without a password).")
@click.option("--url", "url", help="Address of the vehicle's MAVLink endpoint [default: the page asks].")
@console.key_option
@console.radius_option
@console.margin_option
@click.option(
    "--triangles",
    default=60_000,
    show_default=True,
    help="Triangles of the mesh as it is shown first; near the camera up to eight times as many.",
)
@console.common_options
def command(
    project: Path | None,
    port: int,
    host: str,
    tls_cert: Path | None,
    tls_key: Path | None,
    url: str | None,
    key_file: Path | None,
    radius_m: float | None,
    margin_m: float | None,
    triangles: int,
    as_json: bool,
) -> None:
    """Serve the page of PROJECT: plan with undo, check, compare with the vehicle and upload, fly, abort.

    \b
    goshawk gcs demo-out
    goshawk gcs demo-out --url udp://127.0.0.1:14550
    goshawk gcs demo-out --host station.example --tls-cert station.pem --tls-key station.key

    PROJECT is a folder of `goshawk init`, the demo's, or an empty one, which the page fills: with a map, a vehicle,
    flights. Without it the one that was opened last opens. Each printed address lets one browser in; then the next
    one is printed. The page listens on this machine only, unless a certificate is given. It lists the projects in the
    folder that PROJECT is in and those opened before, and opens another one in its place. From another machine,
    forward its port:

    \b
    ssh -L 8080:127.0.0.1:8080 THIS-MACHINE
    """
    if (tls_cert is None) != (tls_key is None):
        raise click.UsageError("--tls-cert and --tls-key belong together; give both")
    import vehicle
    from goshawk.commands.project.project_parts import check_for_station

    vehicle.effects.run_only(())  # between two projects, too: nothing of a project runs before somebody agrees
    from gcs_web.document import recent

    remembered = recent.default_file()
    project = project or _last(remembered)
    check_for_station(project)
    from gcs_web import GroundStation
    from goshawk.commands.fly import others
    from goshawk.station_jobs import KINDS, simulate

    options, wanted = console.body_options(radius_m, margin_m), queue.SimpleQueue[Path]()

    def opened(folder: Path, *, port: int, browsers: Sequence[tuple[str, float]]) -> GroundStation:
        with console.progress() as report:
            return GroundStation(
                folder,
                port=port,
                host=host,
                tls=None if tls_cert is None or tls_key is None else (tls_cert, tls_key),
                vehicle_url=url,
                key_file=key_file,
                options=options,
                triangles=triangles,
                progress=report,
                on_entry=lambda url: _address(url, "a browser has connected; the address for another one: ", as_json),
                jobs=(*KINDS, simulate.kind(key_file)),
                browsers=browsers,
                on_open=wanted.put,
                opened_before=partial(recent.listed, remembered),
                foreign=others.flyer,
            )

    station = opened(project, port=port, browsers=())
    console.note("stop with Ctrl-C; every change is saved at once")
    while True:
        recent.note(remembered, project)
        with station:
            _address(station.url, "open  ", as_json)
            other = wanted.get()
            port, browsers = station.port, station.browsers
        try:
            station = opened(other, port=port, browsers=browsers)
            project = other
        except (FlightError, OSError) as error:
            station = opened(project, port=port, browsers=browsers)
            station.desk.notice(f"{other.name} could not be opened: {error}", level="danger")


def _last(remembered: Path) -> Path:
    from gcs_web.document import recent

    known = recent.listed(remembered)
    if not known:
        raise click.UsageError(
            "no project was opened here yet; goshawk init my-room makes one, then goshawk gcs my-room"
        )
    console.note(f"opening {known[0]}, the last one")
    return known[0]


def _address(url: str, words: str, as_json: bool) -> None:
    """Print an address of the page: a sentence, or a line of JSON."""
    click.echo(json.dumps({"url": url}) if as_json else f"{words}{url}")
