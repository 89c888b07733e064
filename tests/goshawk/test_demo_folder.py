"""The demo runs twice in a row; what somebody did in its folder stays, and no other folder is ever touched."""

from pathlib import Path

import pytest

from flight import InputError, file_format, project
from goshawk import demo_folder


def run(out: Path, text: str) -> None:
    """As much of a demo as its folder sees."""
    with demo_folder.making(out):
        project.create(out, demo_folder.NAME)
        (out / "walk.json").write_text(text)
        body = {"files": demo_folder.hashes(out)}
        file_format.write_json(out / demo_folder.FACTS, format=demo_folder.FORMAT, version=1, body=body)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_an_unchanged_demo_is_replaced_by_the_next(tmp_path):
    for text in ("first", "second"):
        run(tmp_path / "demo", text)
    assert names(tmp_path) == ["demo"]
    assert (tmp_path / "demo" / "walk.json").read_text() == "second"


@pytest.mark.parametrize("mine", ["walk.json", "notes.txt"])
def test_a_demo_that_was_changed_is_kept_beside(tmp_path, mine):
    run(tmp_path / "demo", "first")
    (tmp_path / "demo" / mine).write_text("mine")
    run(tmp_path / "demo", "second")
    assert names(tmp_path) == ["demo", "demo.old-1"]
    assert (tmp_path / "demo.old-1" / mine).read_text() == "mine"


def test_a_demo_that_fails_leaves_the_earlier_one_beside(tmp_path):
    run(tmp_path / "demo", "first")

    def failing() -> None:
        with demo_folder.making(tmp_path / "demo"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        failing()
    assert (tmp_path / "demo.old-1" / "walk.json").read_text() == "first"


def test_another_folder_is_refused(tmp_path):
    project.create(tmp_path / "mine", "my hall")
    before = names(tmp_path / "mine")
    with pytest.raises(InputError, match="not a result"):
        run(tmp_path / "mine", "text")
    assert names(tmp_path / "mine") == before
