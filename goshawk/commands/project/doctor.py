"""`goshawk doctor`: check that libraries and compiled parts work on this machine."""

import importlib
import os
import platform
import shutil
from collections.abc import Callable
from dataclasses import dataclass

import click

from goshawk.terminal import console

_MODULES = {
    "numpy": "", "scipy": "", "osqp": "planning", "ompl": "planning", "pycolmap": "mapping", "cv2": "mapping",
    "open3d": "mapping: needs the system's libusb-1.0-0 and libgl1", "trimesh": "mapping", "pyarrow": "flight logs",
    "viser": "the web page", "aiohttp": "the web page", "matplotlib": "figures",
    "esdf._esdf": "our C++ kernel", "goshawk._rendering": "our C++ kernel", "mapping._mapping": "our C++ kernel",
    "flight._portable": "our C++ kernel",
    "planner._planner": "our C++ kernel", "sysid._sysid": "our C++ kernel", "vehicle._vehicle": "our C++ kernel",
    "firmware_bridge._controller": "the embedded C controller",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Finding:
    name: str
    ok: bool
    detail: str


@click.command()
@console.json_option
def command(as_json: bool) -> int:
    """Check this installation: libraries, compiled parts, memory, browser.

    \b
    goshawk doctor
    goshawk doctor --json
    """
    findings = [_module(name, use) for name, use in _MODULES.items()] + [check() for check in _CHECKS]
    healthy = all(finding.ok for finding in findings)
    if as_json:
        items = [{"name": f.name, "ok": f.ok, "detail": f.detail} for f in findings]
        console.show("", {}, as_json=True, document={"healthy": healthy, "findings": items})
    else:
        rows = [(f.name, "ok" if f.ok else "NOT OK", f.detail) for f in findings]
        console.table("Goshawk's installation", ("what", "state", "detail"), rows)
        click.echo(
            "everything works" if healthy else "run `make setup` in the repository, or install what is named above"
        )
    return 0 if healthy else 1


def _module(name: str, use: str) -> Finding:
    try:
        module = importlib.import_module(name)
    except Exception as error:  # a broken wheel may raise anything
        return Finding(name, False, f"{error} ({use})" if use else str(error))
    return Finding(name, True, str(getattr(module, "__version__", "")))


def _python() -> Finding:
    return Finding("python", True, f"{platform.python_version()} on {platform.system()} {platform.machine()}")


def _memory() -> Finding:
    gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return Finding("memory", gib >= 4.0, f"{gib:.0f} GiB; mapping needs 4" + ("" if gib >= 4.0 else ": too little"))


def _browser() -> Finding:
    found = next((p for p in ("chromium", "google-chrome", "firefox") if shutil.which(p)), None)
    return Finding("browser", True, found or "none on this machine; open the page from another through an SSH tunnel")


_CHECKS: tuple[Callable[[], Finding], ...] = (_python, _memory, _browser)
