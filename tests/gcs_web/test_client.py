"""The page's bundle and its message types are those of the sources beside them."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.waiting import PATIENCE_S
from tools import page_types

CLIENT = Path(page_types.__file__).parents[1] / "gcs_web" / "client"
STATIC = CLIENT.parent / "static"
LARGEST_BUNDLE = 150_000
"""Bytes, gzip."""


def test_the_clients_message_types_are_those_of_the_protocol():
    assert page_types.TARGET.read_text() == page_types.typescript(), "run `python tools/page_types.py`"


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
        ["npm", "run", "--silent", "build"],
    ):
        done = subprocess.run(
            command, cwd=tmp_path / "client", capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    for path in sorted(STATIC.iterdir()):
        assert (tmp_path / "static" / path.name).read_bytes() == path.read_bytes(), path.name
