"""`goshawk doctor`: check that libraries and compiled parts work on this machine."""

import getpass
import importlib
import os
import platform
import re
import shutil
import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

import goshawk
from flight import extras
from goshawk import installation
from goshawk.terminal import console, outputs

SUMMARY = "Check this installation."
_MODULES = {
    "numpy": "", "scipy": "", "osqp": "planning", "ompl": "planning", "pyarrow": "flight logs",
    "pyulog": "PX4's flight logs", "matplotlib": "figures",
    "esdf._esdf": "our C++ kernel", "goshawk._rendering": "our C++ kernel", "mapping._mapping": "our C++ kernel",
    "flight._portable": "our C++ kernel",
    "planner._planner": "our C++ kernel", "preflight._preflight": "our C++ kernel", "sysid._sysid": "our C++ kernel",
    "vehicle._vehicle": "our C++ kernel",
    "firmware_bridge._controller": "the embedded C controller",
}  # fmt: skip
_SYSTEM = {"open3d": "; needs the system's libusb-1.0-0 and libgl1"}


@dataclass(frozen=True, slots=True)
class Finding:
    name: str
    ok: bool
    detail: str


@click.command()
@console.path_option("--out", "out", "Text file to write: this table, to attach to an issue.")
@outputs.overwrite_option
@console.common_options
def command(out: Path | None, overwrite: bool, as_json: bool) -> int:
    """Check this installation: libraries, compiled parts, memory, browser.

    \b
    goshawk doctor
    goshawk doctor --json
    goshawk doctor --out doctor.txt

    The file holds no name of a user, a machine or a home folder.
    """
    outputs.check(out, overwrite=overwrite)
    findings = [_module(name, use) for name, use in _MODULES.items()]
    findings += [_extra(name, libraries) for name, libraries in extras.EXTRAS.items()]
    findings += [check() for check in _CHECKS]
    healthy = all(finding.ok for finding in findings)
    if out is not None:
        with outputs.file(out, overwrite=overwrite) as placing:
            placing.write_text(report(findings))
        console.note(f"written: {out}")
    if as_json:
        items = [{"name": f.name, "ok": f.ok, "detail": f.detail} for f in findings]
        console.show("", {}, as_json=True, document={"healthy": healthy, "findings": items})
    else:
        rows = [(f.name, "ok" if f.ok else "NOT OK", f.detail) for f in findings]
        console.table("Goshawk's installation", ("what", "state", "detail"), rows)
        click.echo(
            "everything that is installed works"
            if healthy
            else "run `make setup` in the repository, or install what is named above"
        )
    return 0 if healthy else 1


def report(findings: Sequence[Finding]) -> str:
    """The findings as text, a line each, without what identifies a person or a machine."""
    lines = [f"Goshawk {goshawk.__version__}"]
    lines += [f"{f.name}: {'ok' if f.ok else 'NOT OK'}{f', {f.detail}' if f.detail else ''}" for f in findings]
    return without_personal_data("\n".join(lines) + "\n")


def without_personal_data(text: str) -> str:
    """The text with the home folder as `~`, and with USER and HOST for the names of the user and the machine."""
    text = re.sub(rf"{re.escape(str(Path.home()))}(?=/|\s|$)", "~", text)
    for name, word in ((_user(), "USER"), (socket.gethostname(), "HOST")):
        if name:
            text = re.sub(rf"(?<![\w.-]){re.escape(name)}(?![\w-])", word, text)
    return text


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a container may run as a number without a name
        return ""


def _module(name: str, use: str) -> Finding:
    try:
        return Finding(name, True, _version(name))
    except Exception as error:  # a broken wheel may raise anything
        return Finding(name, False, f"{error} ({use})" if use else str(error))


def _extra(name: str, libraries: Mapping[str, str]) -> Finding:
    """Libraries may be missing, but those that are there must work."""
    works, missing = [], []
    for module, distribution in libraries.items():
        try:
            works.append(f"{distribution} {_version(module)}".strip())
        except Exception as error:
            if not extras.missing(error):
                return Finding(f"extra {name}", False, f"{distribution}: {error}{_SYSTEM.get(module, '')}")
            missing.append(distribution)
    added = f"not installed; {extras.install(name)} adds {', '.join(missing)}"
    return Finding(f"extra {name}", True, added if missing else ", ".join(works))


def _version(module: str) -> str:
    return str(getattr(importlib.import_module(module), "__version__", ""))


def _names() -> Finding:
    others = [f"{name} is also in {', '.join(found)}" for name, found in installation.other_owners().items()]
    remedy = "; uninstall that, then install Goshawk again" if others else ""
    return Finding("names of packages", not others, "; ".join(others) + remedy)


def _python() -> Finding:
    return Finding("python", True, f"{platform.python_version()} on {platform.system()} {platform.machine()}")


def _memory() -> Finding:
    gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return Finding("memory", gib >= 4.0, f"{gib:.0f} GiB; mapping needs 4" + ("" if gib >= 4.0 else ": too little"))


def _browser() -> Finding:
    found = next((p for p in ("chromium", "google-chrome", "firefox") if shutil.which(p)), None)
    return Finding("browser", True, found or "none on this machine; open the page from another through an SSH tunnel")


_CHECKS: tuple[Callable[[], Finding], ...] = (_names, _python, _memory, _browser)
