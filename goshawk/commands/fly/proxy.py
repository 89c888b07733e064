"""`goshawk proxy`: connects ground stations that cannot sign (QGroundControl, MAVSDK) to a vehicle that requires it."""

import json
import time
from pathlib import Path

import click

from firmware_bridge import keys
from firmware_bridge.port import is_loopback
from firmware_bridge.proxy import DEFAULT_LISTEN, Proxy, ProxyStatus, parse_listen
from goshawk.terminal import console

SUMMARY = "Connect QGroundControl or MAVSDK, which cannot sign, to the vehicle."
_SILENT_S = 2.0
_LOOK_S = 0.5


@click.command()
@console.url_option
@console.key_option
@click.option(
    "--listen", default=DEFAULT_LISTEN, show_default=True, metavar="HOST:PORT", help="Where stations connect."
)
@click.option("--control", is_flag=True, help="Hold control of the vehicle for the first station; else it only reads.")
@console.common_options
def command(url: str, key_file: Path | None, listen: str, control: bool, as_json: bool) -> None:
    """Serve ground stations that cannot sign: frames are signed towards the vehicle and verified from it.

    \b
    goshawk proxy --url udp://192.168.4.1:14550
    goshawk proxy --control --json

    The first line printed is the address to connect QGroundControl or MAVSDK to. With --control the proxy renews the
    vehicle's operator lease for the first station, and stops 2.5 s after that station's last message. Stop with
    Ctrl-C, which releases control. --json prints a line at every change.

    A station at the address needs no key. The address is local to this computer unless --listen changes it.
    """
    host, _ = parse_listen(listen)
    key = keys.load(key_file)
    if not is_loopback(host):
        what = "fly this vehicle" if control else "read this vehicle"
        click.echo(f"warning: whoever reaches {listen} can {what} without the key", err=True)
    with Proxy(url, key, listen=listen, control=control) as proxy:
        click.echo(_line(proxy) if as_json else proxy.url)
        if not as_json:
            console.note("connect a ground station there; stop with Ctrl-C")
        _watch(proxy, as_json)


def _watch(proxy: Proxy, as_json: bool) -> None:
    """Report changes until Ctrl-C, or until the proxy ends by itself."""
    before = proxy.status
    while proxy.running:
        time.sleep(_LOOK_S)
        now = proxy.status
        if _facts(now) == _facts(before):
            continue
        if as_json:
            click.echo(_line(proxy))
        else:
            for sentence in _changes(before, now):
                console.note(sentence)
        before = now


def _line(proxy: Proxy) -> str:
    return json.dumps({"listening": proxy.url, **proxy.status.as_dict()})


def _facts(status: ProxyStatus) -> tuple[object, ...]:
    """The status fields whose changes are reported."""
    return status.stations, status.in_control, status.operator_system, status.vehicle_silent_s > _SILENT_S


def _changes(before: ProxyStatus, now: ProxyStatus) -> list[str]:
    sentences: list[str] = []
    silent = now.vehicle_silent_s > _SILENT_S
    if silent != (before.vehicle_silent_s > _SILENT_S):
        sentences.append(
            f"nothing received from the vehicle for {now.vehicle_silent_s:.0f} s"
            if silent
            else "the vehicle's messages are back"
        )
    for station in sorted(set(now.stations) ^ set(before.stations)):
        sentences.append(f"station {station} {'is connected' if station in now.stations else 'is disconnected'}")
    if (now.in_control, now.operator_system) != (before.in_control, before.operator_system):
        if now.in_control:
            sentences.append(f"station {now.in_control} is in control")
        elif now.operator_system:
            sentences.append(f"station {now.operator_system}, not connected here, is in control")
        else:
            sentences.append("no station is in control")
    return sentences
