"""The page's bundle and its message types are those of the sources beside them."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gcs_web.panels import HANDLERS
from gcs_web.protocol.base import Command
from tests.test_architecture import circles
from tests.waiting import PATIENCE_S
from tools import page_types

CLIENT = Path(page_types.__file__).parents[1] / "gcs_web" / "client"
STATIC = CLIENT.parent / "static"
LARGEST_BUNDLE = 150_000
"""Bytes, gzip."""


def test_the_clients_message_types_are_those_of_the_protocol():
    assert page_types.TARGET.read_text() == page_types.typescript(), "run `python tools/page_types.py`"


FLOORS = (
    "core", "plots", "components", "panels/jobs", "panels/timeline", "panels/compare", "panels/start", "panels/fly",
    "panels/plan", "panels/view", "panels/map", "panels/learn", "panels/frame", ".",
)  # fmt: skip
"""Folders of the client's sources: each imports only from those before it."""


def client_imports() -> dict[Path, set[Path]]:
    """By module of the client, those that it imports."""
    sources = CLIENT / "src"
    modules = {p.relative_to(sources).with_suffix("") for p in sources.rglob("*.ts*") if not p.name.endswith(".d.ts")}
    named = {
        module: re.findall(r'from "(\.[^"]+)"', next(sources.glob(f"{module}.ts*")).read_text()) for module in modules
    }
    return {module: {Path(os.path.normpath(module.parent / name)) for name in names} for module, names in named.items()}


def test_every_command_of_the_protocol_has_a_handler():
    assert set(page_types.tagged(Command)) == set(HANDLERS)


def test_the_clients_folders_import_only_from_those_below_them():
    floors = {Path(folder): floor for floor, folder in enumerate(FLOORS)}
    climbs = [
        f"{module} imports {other}"
        for module, others in client_imports().items()
        for other in others
        if floors[other.parent] > floors[module.parent]
    ]
    assert not climbs


def test_the_clients_modules_import_each_other_in_no_circle():
    named = {str(module): {str(other) for other in others} for module, others in client_imports().items()}
    assert not circles(named)


def test_the_bundle_is_small_and_asks_nobody_else():
    import gzip

    script, style = ((STATIC / name).read_bytes() for name in ("app.js", "app.css"))
    assert len(gzip.compress(script)) + len(gzip.compress(style)) <= LARGEST_BUNDLE
    index = (STATIC / "index.html").read_text()
    assert "<script>" not in index
    assert "style=" not in index
    for text in (index, style.decode()):
        assert "http" not in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("npm") is None, reason="needs npm, from Debian's nodejs or nodejs.org")
def test_the_committed_bundle_equals_a_rebuild(tmp_path):
    shutil.copytree(CLIENT, tmp_path / "client", ignore=shutil.ignore_patterns("node_modules"))
    (tmp_path / "static").mkdir()
    for command in (
        ["npm", "ci", "--silent"],
        ["npm", "run", "--silent", "check"],
        ["npm", "run", "--silent", "bundle"],
    ):
        done = subprocess.run(
            command, cwd=tmp_path / "client", capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    for path in sorted(STATIC.iterdir()):
        assert (tmp_path / "static" / path.name).read_bytes() == path.read_bytes(), path.name
